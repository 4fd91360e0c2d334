"""Paths around obstacles that begin refinements: closed forms along routes through a task's stages."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization.deadline import out_of_time
from aerobat.planning.around.grid import Grid
from aerobat.planning.around.routes import Leg, routes
from aerobat.planning.polynomial.knots import start_along_normals
from aerobat.planning.task import Task
from aerobat.planning.warm_start import WarmStart
from aerobat.problem.condition import Attitude, Quantity, fixed
from aerobat.problem.gate import Gate
from aerobat.problem.stage import Stage

ROUTES = 4  # of which refinement takes the fastest
BEFORE = 0.3  # [m] beyond the body's reach, from which on a gate in a wall is flown along its normal
CLOSEST = 0.5  # [m] from one corner of a route to the next
SHARE = 0.5  # of the room that a narrow passage leaves to the body on its side, which is kept clear
LEAST_CLEARANCE = 0.003  # [m] that is kept clear in the narrowest: what lies between places is within it
EFFORT = 4  # snap: of the derivatives of position whose squares are minimized


class Guess(NamedTuple):
    """A path around obstacles, and the task along it: with no more kept clear than there is room for."""

    path: WarmStart
    task: Task


def guesses(task: Task) -> Iterator[Guess]:
    """Yield paths through a task's stages around obstacles, on different sides of them.

    None where some stage does not say where it is, or there is no way: then only refinement moves a path off
    obstacles.

    Args:
        task: With a vehicle and obstacles.
    """
    places = _places(task)
    if places is None or not task.problem.ends:
        return
    legs = list(zip([begin for _, begin in places[:-1]], [end for end, _ in places[1:]], strict=True))
    lower, upper = task.problem.path_limits.of(0)
    corners = np.array([point for leg in legs for point in leg])
    grid = Grid.around(task.environment.pieces, task.vehicle.bounding_ellipsoid, corners, lower, upper)
    ends = float(grid.pieces.distances(corners[[0, -1]]).min())
    walls = [gate for gate in (_in_wall(task, stage) for stage in task.stages.stages) if gate is not None]
    narrowest = min([ends, *(gate.opening.inradius for gate in walls)])
    body = task.vehicle.bounding_ellipsoid.revolved
    for route in routes(grid, legs, ROUTES):
        room = min(narrowest, route.clearance) - min(body.wide, body.high)
        clearance = min(task.clearance, max(SHARE * room, LEAST_CLEARANCE))
        yield Guess(_along(task, route.legs), replace(task, clearance=clearance))
        if out_of_time():
            return


def _places(task: Task) -> list[Leg] | None:
    """Where the start, each stage and the goal are entered and left [m]; None where one does not say."""
    found = [(task.problem.start.position, task.problem.start.position)]
    for stage in task.stages.stages:
        centre = stage.centre(task.problem.gates)
        place = stage.place if centre is None else centre
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
        stages += [_corner(point) for point in _inner(leg)]
        if k < len(task.stages.stages):
            own.append(len(stages))
            stages.append(_turned(task, task.stages.stages[k]))
    through = replace(task, stages=replace(task.stages, stages=tuple(stages)))
    path = start_along_normals(through, EFFORT)
    return WarmStart(path.trajectory, task.stages.stages, tuple(path.times[k] for k in own))


def _inner(leg: Array) -> list[Array]:
    """The corners between the ends of a leg, none next to another or to an end."""
    kept = [leg[0]]
    for point in leg[1:-1]:
        if min(np.linalg.norm(point - kept[-1]), np.linalg.norm(point - leg[-1])) > CLOSEST:
            kept.append(point)
    return kept[1:]


def _corner(point: Array) -> Stage:
    return Stage("corner", fixed(Quantity.POSITION, point))


def _turned(task: Task, stage: Stage) -> Stage:
    """The stage, with the attitude that its gate's wall leaves to the body: upright in the opening."""
    gate = _in_wall(task, stage)
    if gate is None or stage.attitude is not None or _fits_level(task, gate):
        return stage
    return replace(stage, attitude=Attitude(gate.up, task.environment.gravity))


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
