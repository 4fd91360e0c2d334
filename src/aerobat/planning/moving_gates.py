"""Gates that move: where one is depends on when it is passed, and that on where it is.

A planner plans through the gates as if they stood still where they are when they are passed, again and again
until that is nearly where they are. Its path then crosses the planes of the gates as they move, a little
later or sooner, and its certificate says whether it passes them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import wraps
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
ROUNDS = 12  # at most: a gate at a fifth of the vehicle's speed takes three
SETTLED = 5e-3  # [m] from where a gate is planned to where it is passed: planners' durations vary by as much
STEPS = 6  # of Newton's method


def through_moving_gates(method: PlanMethod[P]) -> PlanMethod[P]:
    """A planner's method `plan` that plans, where gates move, through where they are when they are passed."""

    @wraps(method)
    def plan(
        self: P, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        moving = {gate.name: gate for gate in problem.gates if gate.motion is not None}
        if not moving:
            return method(self, problem, vehicle, progress)
        _require_once(problem, moving)
        gates, why = as_passed(problem.gates, ()), ""
        with within_time(getattr(self, "time_limit", None)):
            for _ in range(ROUNDS):
                found = method(self, replace(problem, gates=gates), vehicle, progress)
                planned, gates = gates, as_passed(problem.gates, found.stages)
                if _farthest(planned, gates) < SETTLED:
                    crossing = _crossing(found, problem, moving)
                    if crossing.certificate is None or crossing.certified:
                        return crossing
                    why = crossing.certificate.why
        sentence = (
            f"'{problem.name}' has no plan through its gates as they move: after {ROUNDS} rounds "
            f"{why or 'they are not where they are planned when they are passed'}; let them move more slowly"
        )
        raise Infeasible(Reason(sentence, tuple(f"gate '{name}'" for name in moving)), found.attempts)

    return plan


def _require_once(problem: Problem, moving: dict[str, Gate]) -> None:
    """Refuse gates that move and are not passed once: at which time they are meant is not known."""
    passed = [stage.gate for stage in problem.stages(1.0).stages]
    for name in moving:
        if passed.count(name) != 1 or not problem.ends:
            raise SpecError(f"gate '{name}' moves, and is not passed once; let it stand still")


def _farthest(gates: Sequence[Gate], others: Sequence[Gate]) -> float:
    """The largest distance [m] between gates of both that are the same."""
    return max(float(np.linalg.norm(a.position - b.position)) for a, b in zip(gates, others, strict=True))


def _crossing(found: Plan, problem: Problem, moving: dict[str, Gate]) -> Plan:
    """The plan with its stages where its path crosses the gates as they move."""
    stages = tuple(
        replace(place, time=_crossed(found.trajectory, moving[place.gate], place.time))
        if place.gate in moving
        else place
        for place in found.stages
    )
    return replace(found, problem=problem, stages=stages)


def _crossed(path: Trajectory, gate: Gate, time: float) -> float:
    """The time [s] near one at which a path crosses a gate's plane."""
    assert gate.motion is not None, "gates that stand still are crossed where they are planned"
    for _ in range(STEPS):
        ahead = float((path.evaluate(time) - gate.places(np.array(time))) @ gate.normal)
        speed = float((path.evaluate(time, 1) - gate.motion.velocity_at(time)) @ gate.normal)
        if abs(speed) < CROSSING_SPEED:
            break
        time = float(np.clip(time - ahead / speed, 0.0, path.duration))
    return time
