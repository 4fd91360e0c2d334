"""Passages that flights are judged by: a plan's, or a problem's at the nearest approaches to its gates."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from aerobat.arrays import Array
from aerobat.certification import PlannedPassage
from aerobat.planning import Plan, planned_passages
from aerobat.problem.gate import Gate
from aerobat.problem.problem import Problem
from aerobat.problem.stage import Stage
from aerobat.simulation.passages import PASSAGE_WINDOW


def passages_asked(goal: Problem | Plan, times: Array, position: Array) -> tuple[PlannedPassage, ...]:
    """The passages of gates in the order of the stages, of all gates where no stage names one.

    When is said by a plan's stages; otherwise by the set-points' nearest approach to the gate's centre, after
    the last one of the same gate.

    Args:
        goal: the problem, or a plan for it.
        times: of the set-points [s], (T,).
        position: of the set-points [m], (T, 3).
    """
    problem = goal.problem if isinstance(goal, Plan) else goal
    planned = planned_passages(goal.stages, problem) if isinstance(goal, Plan) else ()
    if planned:
        return planned
    stages = [stage for stage in problem.stages(1.0).stages if stage.gate is not None]
    asked = [(problem.gate(str(stage.gate)), stage) for stage in stages]
    asked = asked or [(gate, Stage(gate.name)) for gate in problem.gates]
    instants = _nearest_instants([gate for gate, _ in asked], times, position)
    return tuple(PlannedPassage.of(stage, gate, t) for (gate, stage), t in zip(asked, instants, strict=True))


def _nearest_instants(gates: Sequence[Gate], times: Array, position: Array) -> Iterator[float]:
    latest: dict[str, float] = {}
    for gate in gates:
        distance = np.linalg.norm(position - gate.position, axis=-1)
        after = latest.get(gate.name, -np.inf) + PASSAGE_WINDOW
        latest[gate.name] = float(times[int(np.argmin(np.where(times > after, distance, np.inf)))])
        yield latest[gate.name]
