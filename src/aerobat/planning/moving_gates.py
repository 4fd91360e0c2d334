"""Gates that move: the position of a gate depends on the time of passage, and the time on the position.

This is solved by fixed-point iteration. Each round plans through gates at rest, at their positions when the
last round's plan passes them, until these positions converge. The final path crosses the moving planes
slightly earlier or later, and its certificate says whether it passes the gates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from aerobat.errors import Infeasible, Reason, SpecError
from aerobat.optimization.deadline import within_time
from aerobat.planning.passages import as_passed
from aerobat.planning.recorder import Progress
from aerobat.planning.result import Plan, PlanMethod
from aerobat.problem import Gate, Problem
from aerobat.problem.planned_passage import CROSSING_SPEED
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

P = TypeVar("P")
ROUNDS = 12  # largest number of rounds; a gate with a fifth of the vehicle's speed takes three
# change of gates' positions below which rounds end [m]: planners' durations vary by as much
POSITION_TOLERANCE = 5e-3
STEPS = 6  # steps of Newton's method for the time of crossing


def through_moving_gates(
    method: PlanMethod[P], planner: P, problem: Problem, vehicle: Vehicle | None, progress: Progress | None
) -> Plan:
    """Return a problem's plan by a planner's method, through moving gates by fixed-point iteration."""
    moving = {gate.name: gate for gate in problem.gates if gate.motion is not None}
    if not moving:
        return method(planner, problem, vehicle, progress)
    _require_once(problem, moving)
    gates, why = as_passed(problem.gates, ()), ""
    with within_time(getattr(planner, "time_limit", None)):
        for _ in range(ROUNDS):
            found = method(planner, replace(problem, gates=gates), vehicle, progress)
            planned, gates = gates, as_passed(problem.gates, found.stages)
            if _farthest(planned, gates) < POSITION_TOLERANCE:
                crossing = _crossing(found, problem, moving)
                if crossing.certificate is None or crossing.certified:
                    return crossing
                why = crossing.certificate.why
    sentence = (
        f"'{problem.name}' has no plan through its gates as they move: after {ROUNDS} rounds "
        f"{why or 'they are not where they are planned when they are passed'}; let them move more slowly"
    )
    raise Infeasible(Reason(sentence, tuple(f"gate '{name}'" for name in moving)), found.attempts)


def _require_once(problem: Problem, moving: dict[str, Gate]) -> None:
    """Raise SpecError for moving gates that are not passed exactly once: their time would be ambiguous."""
    passed = [stage.gate for stage in problem.stages(1.0).stages]
    for name in moving:
        if passed.count(name) != 1 or not problem.ends:
            raise SpecError(f"gate '{name}' moves, and is not passed once; let it stand still")


def _farthest(gates: Sequence[Gate], others: Sequence[Gate]) -> float:
    """Return the largest distance [m] between corresponding gates."""
    return max(float(np.linalg.norm(a.position - b.position)) for a, b in zip(gates, others, strict=True))


def _crossing(found: Plan, problem: Problem, moving: dict[str, Gate]) -> Plan:
    """Return the plan with its stages at the times at which its path crosses the moving gates."""
    stages = tuple(
        replace(place, time=_crossed(found.trajectory, moving[place.gate], place.time))
        if place.gate in moving
        else place
        for place in found.stages
    )
    return replace(found, problem=problem, stages=stages)


def _crossed(path: Trajectory, gate: Gate, time: float) -> float:
    """Return the time [s], near a given one, at which a path crosses a moving gate's plane."""
    assert gate.motion is not None, "gates that stand still are crossed where they are planned"
    for _ in range(STEPS):
        ahead = float((path.evaluate(time) - gate.places(np.array(time))) @ gate.normal)
        speed = float((path.evaluate(time, 1) - gate.motion.velocity_at(time)) @ gate.normal)
        if abs(speed) < CROSSING_SPEED:
            break
        time = float(np.clip(time - ahead / speed, 0.0, path.duration))
    return time
