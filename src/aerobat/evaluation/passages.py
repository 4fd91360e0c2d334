"""Passages that flights are judged by: a plan's, or a problem's where the set-points come nearest."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from aerobat.arrays import Array
from aerobat.certification import PlannedPassage, PlannedWaypoint
from aerobat.planning import Plan, planned_passages, planned_waypoints
from aerobat.problem.problem import Problem
from aerobat.problem.stage import Stage
from aerobat.simulation.passages import PASSAGE_WINDOW


class Asked(NamedTuple):
    """Passages of gates and waypoints, each in the order of the stages."""

    gates: tuple[PlannedPassage, ...]
    waypoints: tuple[PlannedWaypoint, ...]
    lap_begin: float = 0.0  # [s] when the first lap begins


NOTHING_ASKED = Asked((), ())


def passages_asked(goal: Problem | Plan, times: Array, position: Array) -> Asked:
    """The passages in the order of the stages, of all gates where no stage names one or has a ball.

    The first lap begins with the path; a closed one's with the last passage, a whole round before that.

    When is said by a plan's stages; otherwise by the set-points' nearest approaches to the centres, those of
    stages that follow one another in their order.

    Args:
        goal: the problem, or a plan for it.
        times: of the set-points [s], (T,).
        position: of the set-points [m], (T, 3).
    """
    asked = _asked(goal, times, position)
    problem = goal.problem if isinstance(goal, Plan) else goal
    passed = [gate.time for gate in asked.gates] + [waypoint.time for waypoint in asked.waypoints]
    latest = max(passed, default=0.0)
    return asked if problem.ends else asked._replace(lap_begin=latest - float(times[-1]))


def _asked(goal: Problem | Plan, times: Array, position: Array) -> Asked:
    """The passages, whenever the first lap begins."""
    problem = goal.problem if isinstance(goal, Plan) else goal
    if isinstance(goal, Plan):
        planned = Asked(planned_passages(goal.stages, problem), planned_waypoints(goal.stages, problem))
        if planned != NOTHING_ASKED:
            return planned
    sequence = problem.stages(1.0)
    stages = [stage for stage in sequence.stages if stage.gate is not None or stage.ball is not None]
    stages = stages or [Stage(gate.name, gate=gate.name) for gate in problem.gates]
    centres = np.reshape([stage.centre(problem.gates) for stage in stages], (-1, 3))
    in_order = sequence.ordered and bool(sequence.stages)
    placed = list(zip(stages, _nearest_instants(centres, times, position, in_order), strict=True))
    return Asked(
        tuple(PlannedPassage.of(s, problem.gate(s.gate), t) for s, t in placed if s.gate is not None),
        tuple(PlannedWaypoint(s.name, s.ball, t, s.lap) for s, t in placed if s.ball is not None),
    )


def _nearest_instants(centres: Array, times: Array, position: Array, in_order: bool) -> list[float]:
    """The instants of the nearest approaches; in order those of the least sum of squared distances.

    Args:
        centres: of what is passed [m], (n, 3).
        times: of the set-points [s], (T,).
        position: of the set-points [m], (T, 3).
        in_order: true where one follows the other, and what is passed again is later by PASSAGE_WINDOW.
    """
    squares = [np.sum((position - centre) ** 2, axis=-1) for centre in centres]
    if not in_order or not squares:
        return [float(times[int(np.argmin(square))]) for square in squares]
    gaps = [0.0, *(PASSAGE_WINDOW if (a == b).all() else 0.0 for a, b in pairwise(centres))]
    before = [np.searchsorted(times, times - gap, side="right") for gap in gaps]  # rows that may come before
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
