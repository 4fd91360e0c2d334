"""Starts of refinements around obstacles: closed forms along routes through a task's stages."""

from __future__ import annotations

from bisect import bisect
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise, product
from math import ceil, sqrt
from typing import NamedTuple

import numpy as np

from aerobat.arrays import Array
from aerobat.planning.around.cells import Cells
from aerobat.planning.around.routes import GridRoute, Leg, routes, straightened
from aerobat.planning.polynomial.closed_forms import start_along_normals
from aerobat.planning.task import CLEARANCE_FRACTION, Task
from aerobat.planning.warm_start import WarmStart
from aerobat.problem.condition import Attitude, Quantity, fixed
from aerobat.problem.gate import Gate
from aerobat.problem.stage import Stage

ROUTES = 4  # number of routes; the refinement takes the fastest
BEFORE = 0.3  # distance [m] beyond the body's reach at which the flight along a wall gate's normal begins
MIN_CORNER_DISTANCE = 0.5  # least distance [m] between the corners of a route
# (slack of straight lines in cells, factor on the closed form's duration), tried in turn: slow starts lead
# through slits, starts without slack through windows
STARTS = ((0.1, 1.4), (0.0, 1.4), (0.1, 1.8), (0.0, 1.0))
SIDEWAYS = (0.1, 2.6)  # the first start of a body on its side: slow ones lead through narrow slits soonest
EXPECTED_THRUST_FRACTION = 0.5  # fraction of the thrust that accelerates the vehicle in the expected duration
# factors on the expected duration: routes pass behind moving obstacles, or in front
PASSING_TIME_FACTORS = (1.0, 1.4, 0.7)
BOTH_WAYS = 0.5  # z component of a gate's `up` axis below which both ways to turn the body are tried
TOLERANCE = 0.1  # attitude tolerance of a body on its side in the first refinement [rad]
ROOMS = 101  # number of clearances, from zero on, among which the largest that wall gates leave is found
LEAST_THRUST = 0.4  # least specific thrust of a body on its side, relative to gravity
EFFORT = 4  # the derivative of position whose square the closed form minimizes: snap


class Guess(NamedTuple):
    """A path around obstacles, and its task, whose clearance is reduced to the room along the path."""

    path: WarmStart
    task: Task
    turned: Task | None  # refined first: the body on its side, without the walls that it passes like that


def guesses(task: Task, count: int = ROUTES) -> Iterator[list[Guess]]:
    """Yield batches of paths through a task's stages around obstacles, one batch for each way to start.

    The paths of a batch pass on different sides of obstacles. The batches that succeed most often come first.
    Others have another pace, or the body turned the other way in slits. Nothing is yielded where a stage has
    no position, or where there is no route.

    Args:
        task: A task with a vehicle and obstacles.
        count: Number of routes, at most.
    """
    places = _places(task)
    if places is None or not task.problem.ends:
        return
    legs = [(begin, end) for (_, begin), (end, _) in pairwise(places)]
    lower, upper = task.problem.path_limits.of(0)
    corners = np.array([point for leg in legs for point in leg])
    pieces = task.environment.pieces
    duration = _expected_duration(task, corners)
    grids = [
        Cells.around(pieces, task.vehicle.bounding_ellipsoid, corners, lower, upper, factor * duration)
        for factor in (PASSING_TIME_FACTORS if pieces.moving else PASSING_TIME_FACTORS[:1])
    ]
    in_holes, thin = _room_in_holes(task), min(task.vehicle.bounding_ellipsoid.revolved[:2])
    found = [(grid, route) for grid in grids for route in routes(grid, legs, ceil(count / len(grids)))]
    turns = _turned(task) if found else ()
    for turned, (slack, pace) in product(turns, (SIDEWAYS, *STARTS) if any(turns) else STARTS):
        paths = []
        for flown, clear in _different(found, slack):
            room = min(in_holes, clear - thin)
            path = _along(turned or task, flown).time_scaled(pace)
            paths.append(Guess(path, task.with_room(room), turned and turned.with_room(room)))
        yield paths


def _room_in_holes(task: Task) -> float:
    """Return the distance [m] that the body can keep from all wall gates' edges, up to the needed one."""
    holes = [gate.opening for gate in (_in_wall(task, stage) for stage in task.stages.stages) if gate]
    small, large = sorted(task.vehicle.bounding_ellipsoid.revolved[:2])
    rooms: list[float] = np.linspace(0.0, task.clearance / CLEARANCE_FRACTION, ROOMS).tolist()

    def is_too_much(room: float) -> bool:
        return not all(hole.admits_turned(small + room, large + room) for hole in holes)

    return rooms[max(bisect(rooms, False, key=is_too_much) - 1, 0)]


def _expected_duration(task: Task, corners: Array) -> float:
    """Return the expected duration [s] along corners (k, 3): rest to rest by thrust, or at the top speed."""
    _, greatest = task.problem.path_limits.of(1)
    steps = np.diff(corners, axis=0)
    length = float(np.linalg.norm(steps, axis=1).sum())
    at_speed = float((np.abs(steps) / greatest).max(axis=1).sum())
    return max(2.0 * sqrt(length / (EXPECTED_THRUST_FRACTION * task.vehicle.max_specific_thrust)), at_speed)


def _different(found: Iterable[tuple[Cells, GridRoute]], slack: float) -> Iterator[tuple[list[Array], float]]:
    """Yield each route's corners and clearance [m], without routes whose corners an earlier route has."""
    known: list[Array] = []
    for grid, route in found:
        legs = [straightened(grid, leg, slack) for leg in route.legs]
        corners = np.concatenate(legs)
        if not any(len(x) == len(corners) and np.abs(x - corners).max() < MIN_CORNER_DISTANCE for x in known):
            known.append(corners)
            yield legs, route.clearance


def _places(task: Task) -> list[Leg] | None:
    """Return the positions [m] at which start, stages and goal are entered and left, or None.

    None is returned where a stage has no position.
    """
    found = [(task.problem.start.position, task.problem.start.position)]
    for stage in task.stages.stages:
        place = stage.position(task.problem.gates)
        if np.isnan(place).any():
            return None
        gate = _in_wall(task, stage)
        ahead = np.zeros(3) if gate is None else (task.vehicle.body_radius + BEFORE) * gate.normal
        found.append((place - ahead, place + ahead))
    goal = task.problem.goal.position
    return [*found, (goal, goal)]


def _along(task: Task, route: Sequence[Array]) -> WarmStart:
    """Return the closed form along a route, with each corner as an additional stage."""
    stages: list[Stage] = []
    own: list[int] = []
    for k, leg in enumerate(route):
        stages += [Stage("corner", fixed(Quantity.POSITION, point)) for point in _inner(leg)]
        if k < len(task.stages.stages):
            own.append(len(stages))
            stages.append(task.stages.stages[k])
    path = start_along_normals(task.with_stages(stages), EFFORT)
    return WarmStart(path.trajectory, task.stages.stages, tuple(path.times[k] for k in own))


def _inner(leg: Array) -> list[Array]:
    """Return the inner corners of a leg, MIN_CORNER_DISTANCE or more from each other and from its ends."""
    kept = [leg[0]]
    for point in leg[1:-1]:
        if min(np.linalg.norm(point - kept[-1]), np.linalg.norm(point - leg[-1])) > MIN_CORNER_DISTANCE:
            kept.append(point)
    return kept[1:]


def _turned(task: Task) -> tuple[Task | None, ...]:
    """Return the task with the body on its side in narrow wall gates, without these walls.

    The body is turned one way, and also the other way if a gate's `up` axis is far from vertical. None alone
    is returned where the body fits level through all gates.
    """
    gates = {gate.name: gate for gate in task.problem.gates if gate.wall and not _fits_level(task, gate)}
    if not gates:
        return (None,)
    open_gates = tuple(
        replace(gate, wall=None) if gate.name in gates else gate for gate in task.problem.gates
    )
    problem = replace(task.problem, gates=open_gates)
    found = []
    for sign in (1.0, -1.0):
        stages = (
            stage if stage.gate not in gates else _on_its_side(task, stage, sign * gates[stage.gate].up)
            for stage in task.stages.stages
        )
        found.append(replace(task, problem=problem).with_stages(stages))
    steepest = min(gate.up[2] for gate in gates.values())
    return tuple(found if steepest < BOTH_WAYS else found[:1])


def _on_its_side(task: Task, stage: Stage, up: Array) -> Stage:
    """Return the stage with an attitude with its thrust along `up`; stages with an attitude are unchanged."""
    if stage.attitude is not None:
        return stage
    attitude = Attitude(up, LEAST_THRUST * task.environment.gravity, TOLERANCE)
    return replace(stage, attitude=attitude, conditions=(*stage.conditions, *attitude.conditions))


def _fits_level(task: Task, gate: Gate) -> bool:
    """Return whether the body fits through a gate's opening in its hover attitude."""
    revolved = task.vehicle.bounding_ellipsoid.revolved
    _, shape = revolved.turned(np.array([0.0, 0.0, 1.0]))
    across = gate.plane_axes @ shape
    return gate.opening.admits(across @ across.T)


def _in_wall(task: Task, stage: Stage) -> Gate | None:
    """Return a stage's gate if it is an opening in a wall, else None."""
    gate = None if stage.gate is None else task.problem.gate(stage.gate)
    return None if gate is None or gate.wall is None else gate
