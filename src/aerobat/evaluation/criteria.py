"""Criteria for flights: the passages of a plan, or of a problem at the set-points' nearest approaches.

Gates and waypoints have their own tolerances. The problem's tolerance applies to the goal and to other
stages, and to the whole path where there is no gate or waypoint.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import degrees, inf, isfinite
from typing import NamedTuple

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import unit
from aerobat.kernels.gates import approach
from aerobat.planning import Plan
from aerobat.planning.passages import timed_stages
from aerobat.problem.ball import Ball
from aerobat.problem.condition import Quantity
from aerobat.problem.planned_passage import PlannedPassage, PlannedWaypoint
from aerobat.problem.problem import Problem
from aerobat.problem.stage import Stage
from aerobat.simulation.metrics import Criteria
from aerobat.simulation.outcome import length
from aerobat.simulation.passages.log import log_rows, scan_log
from aerobat.simulation.passages.passage import PASSAGE_WINDOW
from aerobat.simulation.passages.stages import PlannedAttitude, waypoint_target
from aerobat.so3 import thrust_axis

GOAL = "the goal"  # the name of a path's end among the places to reach


class SampledPath(NamedTuple):
    """The set-points of a path."""

    times: Array  # [s], (T,)
    position: Array  # [m], (T, 3)
    q_world_body: Array  # (T, 4)


def criteria_of(goal: Problem | Plan, path: SampledPath) -> Criteria:
    """Return the criteria of flights: passages in the order of the stages, or of all gates.

    All gates are used where the problem has no stages. The first lap begins at the start of the path. The
    first lap of a closed course begins one path duration before the path's last passage.

    A plan's stages give the times of passages. Without a plan the times are those of the set-points' nearest
    approaches to the centres, in the stages' order where they have one.
    """
    problem = goal.problem if isinstance(goal, Plan) else goal
    tolerance = problem.tolerance
    placed = timed_stages(goal.stages, problem) if isinstance(goal, Plan) else ()
    passed = [(stage, time) for stage, time in placed if stage.gate is not None or stage.ball is not None]
    others = [(stage, time) for stage, time in placed if stage.gate is None and stage.ball is None]
    passed = passed or _nearest_stages(problem, path)
    gates = tuple(PlannedPassage.of(s, problem.gate(s.gate), t) for s, t in passed if s.gate is not None)
    waypoints = tuple(PlannedWaypoint(s.name, s.ball, t, s.lap) for s, t in passed if s.ball is not None)
    places = [
        PlannedWaypoint(s.name, Ball(_between(path, path.position, t), tolerance.position), t, s.lap)
        for s, t in others
        if s.where
    ]
    if problem.ends:
        end = float(path.times[-1])
        places.append(PlannedWaypoint(GOAL, Ball(path.position[-1], tolerance.position), end))
    axes = thrust_axis(path.q_world_body)
    attitudes = [
        PlannedAttitude(s.name, unit(_between(path, axes, t)), t, tolerance.attitude, s.lap)
        for s, t in others
        if _requires_attitude(s)
    ]
    duration = goal.duration if isinstance(goal, Plan) else float(path.times[-1])
    return Criteria(
        gates=gates,
        waypoints=waypoints,
        lap_begin=0.0 if problem.ends else _latest(gates, waypoints, path) - duration,
        places=tuple(places),
        attitudes=tuple(attitudes),
        path_radius=inf if passed else tolerance.position,
    )


def _latest(
    gates: Sequence[PlannedPassage], waypoints: Sequence[PlannedWaypoint], path: SampledPath
) -> float:
    """Return the time of the path's last passage [s]; at a waypoint that is the nearest approach."""
    rows = log_rows(path.times, path.position, np.zeros_like(path.position), path.q_world_body)
    found = scan_log(approach, [waypoint_target(each) for each in waypoints], rows)
    met = [float(each.time[0]) for each in found]  # infinite where the path ends before
    met = [time if isfinite(time) else each.time for time, each in zip(met, waypoints, strict=True)]
    return max([*(gate.time for gate in gates), *met], default=0.0)


def _requires_attitude(stage: Stage) -> bool:
    """Return True for an attitude, or a specific thrust with one component fixed."""
    across = (c.quantity is Quantity.SPECIFIC_THRUST and c.lower == c.upper for c in stage.conditions)
    return stage.attitude is not None or any(across)


def _between(path: SampledPath, values: Array, time: float) -> Array:
    """Return the value (3,) at a time [s], interpolated linearly between the set-points' values (T, 3)."""
    return np.array([np.interp(time, path.times, component) for component in values.T])


def criterion(problem: Problem) -> str:
    """Return the criteria of a successful flight, in words."""
    stages = _passed_stages(problem)
    tolerance = problem.tolerance
    passed = [
        *(["gates as asked"] if any(stage.gate is not None for stage in stages) else []),
        *(["waypoints within their radius"] if any(stage.ball for stage in stages) else []),
    ]
    within = "the goal and the places of other stages" if passed else "the whole path"
    angle = f"{degrees(tolerance.attitude):.3g}°"
    tolerances = f"{within} within {length(tolerance.position)}, attitudes of stages within {angle}"
    clear = ["no obstacle touched"] if problem.surroundings.obstacles else []
    return ", ".join([*passed, *clear, tolerances])


def _passed_stages(problem: Problem) -> list[Stage]:
    """Return the stages with a gate or a ball, or those of all gates where the problem has no stages."""
    stages = problem.stages(1.0).stages or [Stage(gate.name, gate=gate.name) for gate in problem.gates]
    return [stage for stage in stages if stage.gate is not None or stage.ball is not None]


def _nearest_stages(problem: Problem, path: SampledPath) -> list[tuple[Stage, float]]:
    """Return the stages of `_passed_stages`, each with the time [s] of the nearest set-point."""
    sequence, stages = problem.stages(1.0), _passed_stages(problem)
    centres = [_centre(stage, problem, path.times) for stage in stages]
    in_order = sequence.ordered and bool(sequence.stages)
    return list(zip(stages, _nearest_instants(centres, path.times, path.position, in_order), strict=True))


def _centre(stage: Stage, problem: Problem, times: Array) -> Array:
    """Return the centre of a gate or a ball [m], (3,), or of a moving gate at times (T,), (T, 3)."""
    if stage.gate is not None:
        return problem.gate(stage.gate).places(times)
    assert stage.ball is not None, "what is passed is a gate or a ball"
    return stage.ball.centre


def _nearest_instants(centres: Sequence[Array], times: Array, position: Array, in_order: bool) -> list[float]:
    """Return the times of the nearest approaches [s].

    With `in_order` they minimize the sum of squared distances over all ordered times, by dynamic programming.

    Args:
        centres: centres of the gates or balls [m], (3,), or at the times, (T, 3).
        times: times of the set-points [s], (T,).
        position: positions of the set-points [m], (T, 3).
        in_order: whether the approaches must be in order; repeated centres are then at least PASSAGE_WINDOW
            apart.
    """
    squares = [np.sum((position - centre) ** 2, axis=-1) for centre in centres]
    if not in_order or not squares:
        return [float(times[int(np.argmin(square))]) for square in squares]
    gaps = [0.0, *(PASSAGE_WINDOW if (a == b).all() else 0.0 for a, b in pairwise(centres))]
    # number of rows that may come before each row
    before = [np.searchsorted(times, times - gap, side="right") for gap in gaps]
    best = np.zeros(len(times) + 1)
    sums = []
    for square, rows in zip(squares, before, strict=True):
        sums.append(square + best[rows])
        best = np.append(np.inf, np.minimum.accumulate(sums[-1]))
    chosen: list[int] = []
    end = len(times)
    for total, rows in zip(reversed(sums), reversed(before), strict=True):
        chosen.append(int(np.argmin(total[: max(end, 1)])))
        end = int(rows[chosen[-1]])
    return [float(times[k]) for k in reversed(chosen)]
