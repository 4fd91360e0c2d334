"""Paths around obstacles that begin refinements: closed forms along routes through a task's stages."""

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
from aerobat.planning.around.routes import Leg, Way, routes, straightened
from aerobat.planning.polynomial.knots import start_along_normals
from aerobat.planning.task import SHARE, Task
from aerobat.planning.warm_start import WarmStart
from aerobat.problem.condition import Attitude, Quantity, fixed
from aerobat.problem.gate import Gate
from aerobat.problem.stage import Stage

ROUTES = 4  # of which refinement takes the fastest
BEFORE = 0.3  # [m] beyond the body's reach, from which on a gate in a wall is flown along its normal
CLOSEST = 0.5  # [m] from one corner of a route to the next
# how near straight lines cut corners, of a cell, and times the duration of a closed form, in turn: slits are
# reached from slow ones, windows by those that cut no corner
STARTS = ((0.1, 1.4), (0.0, 1.4), (0.1, 1.8), (0.0, 1.0))
SIDEWAYS = (0.1, 2.6)  # the first of a body on its side: from slower ones narrow slits are reached soonest
HURRIED = 0.5  # of the vehicle's thrust that accelerates it, by which the duration is foreseen
LATE = (1.0, 1.4, 0.7)  # times that duration, at which routes pass what moves: behind it, or in front
BOTH_WAYS = 0.5  # of an upright's height, below which the body may turn either way
TOLERANCE = 0.1  # [rad] of a body on its side, at first
ROOMS = 101  # from none to as much as will do, of which the most is found that holes in walls leave
LEAST_THRUST = 0.4  # of gravity, of a body on its side
EFFORT = 4  # snap: of the derivatives of position whose squares are minimized


class Guess(NamedTuple):
    """A path around obstacles, and the task along it: with no more kept clear than there is room for."""

    path: WarmStart
    task: Task
    turned: Task | None  # refined first: without walls that are passed on its side, but turned so


def guesses(task: Task, count: int = ROUTES) -> Iterator[list[Guess]]:
    """Yield paths through a task's stages around obstacles, those on different sides of them together.

    First come those that lead on most often, then others: at other paces, turned the other way in slits.
    Nothing is yielded where some stage does not say where it is, or there is no way.

    Args:
        task: With a vehicle and obstacles.
        count: Of the routes, at most.
    """
    places = _places(task)
    if places is None or not task.problem.ends:
        return
    legs = [(begin, end) for (_, begin), (end, _) in pairwise(places)]
    lower, upper = task.problem.path_limits.of(0)
    corners = np.array([point for leg in legs for point in leg])
    pieces = task.environment.pieces
    hurried = _hurried(task, corners)
    grids = [
        Cells.around(pieces, task.vehicle.bounding_ellipsoid, corners, lower, upper, late * hurried)
        for late in (LATE if pieces.moving else LATE[:1])
    ]
    in_holes, thin = _room_in_holes(task), min(task.vehicle.bounding_ellipsoid.revolved[:2])
    found = [(grid, way) for grid in grids for way in routes(grid, legs, ceil(count / len(grids)))]
    turns = _turned(task) if found else ()
    for turned, (slack, pace) in product(turns, (SIDEWAYS, *STARTS) if any(turns) else STARTS):
        paths = []
        for flown, clear in _different(found, slack):
            room = min(in_holes, clear - thin)
            path = _along(turned or task, flown).time_scaled(pace)
            paths.append(Guess(path, task.with_room(room), turned and turned.with_room(room)))
        yield paths


def _room_in_holes(task: Task) -> float:
    """The distance [m] that the body can keep from the edges of all holes in walls, or as much as will do."""
    holes = [gate.opening for gate in (_in_wall(task, stage) for stage in task.stages.stages) if gate]
    small, large = sorted(task.vehicle.bounding_ellipsoid.revolved[:2])
    rooms: list[float] = np.linspace(0.0, task.clearance / SHARE, ROOMS).tolist()

    def is_too_much(room: float) -> bool:
        return not all(hole.admits_turned(small + room, large + room) for hole in holes)

    return rooms[max(bisect(rooms, False, key=is_too_much) - 1, 0)]


def _hurried(task: Task, corners: Array) -> float:
    """The duration [s] from rest to rest along corners (k, 3) at much of the thrust, or at greatest speed."""
    _, greatest = task.problem.path_limits.of(1)
    way = np.diff(corners, axis=0)
    length = float(np.linalg.norm(way, axis=1).sum())
    at_speed = float((np.abs(way) / greatest).max(axis=1).sum())
    return max(2.0 * sqrt(length / (HURRIED * task.vehicle.max_specific_thrust)), at_speed)


def _different(found: Iterable[tuple[Cells, Way]], slack: float) -> Iterator[tuple[list[Array], float]]:
    """Yield the corners of ways and their clearances [m], but of ways whose corners one before has."""
    known: list[Array] = []
    for grid, way in found:
        legs = [straightened(grid, leg, slack) for leg in way.legs]
        corners = np.concatenate(legs)
        if not any(len(x) == len(corners) and np.abs(x - corners).max() < CLOSEST for x in known):
            known.append(corners)
            yield legs, way.clearance


def _places(task: Task) -> list[Leg] | None:
    """Where the start, each stage and the goal are entered and left [m]; None where one does not say."""
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
    """The closed form along a route, with a corner of it as a stage of its own each."""
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
    """The corners between the ends of a leg, none next to another or to an end."""
    kept = [leg[0]]
    for point in leg[1:-1]:
        if min(np.linalg.norm(point - kept[-1]), np.linalg.norm(point - leg[-1])) > CLOSEST:
            kept.append(point)
    return kept[1:]


def _turned(task: Task) -> tuple[Task | None, ...]:
    """The task without the walls that the body passes on its side, but turned so, one way and the other.

    None alone where it fits level.
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
    """The stage with its thrust along a direction, where it asks no attitude."""
    if stage.attitude is not None:
        return stage
    attitude = Attitude(up, LEAST_THRUST * task.environment.gravity, TOLERANCE)
    return replace(stage, attitude=attitude, conditions=(*stage.conditions, *attitude.conditions))


def _fits_level(task: Task, gate: Gate) -> bool:
    """True if the body passes a gate's opening as it hovers."""
    revolved = task.vehicle.bounding_ellipsoid.revolved
    _, shape = revolved.turned(np.array([0.0, 0.0, 1.0]))
    across = gate.plane_axes @ shape
    return gate.opening.admits(across @ across.T)


def _in_wall(task: Task, stage: Stage) -> Gate | None:
    """The gate of a stage that is a hole in a wall."""
    gate = None if stage.gate is None else task.problem.gate(stage.gate)
    return None if gate is None or gate.wall is None else gate
