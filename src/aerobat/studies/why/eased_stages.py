"""Problems whose stages ask less than their maneuver's: what would free one that has no plan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from aerobat.problem import CustomManeuver, Problem
from aerobat.problem.condition import Condition
from aerobat.problem.stage import Stage

HALF = 0.5


def eased(problem: Problem, max_specific_thrust: float, ease: Callable[[Stage], Stage]) -> Problem:
    """The problem with every stage eased, spelled out as stages.

    Args:
        problem: Whose maneuver says them.
        max_specific_thrust: Of the vehicle [m/s²], by which stages ask.
        ease: A stage that asks less than another.
    """
    sequence = problem.maneuver.stage_sequence(problem.gates, max_specific_thrust)
    stages = tuple(map(ease, sequence.stages))
    maneuver = CustomManeuver(stages, sequence.path_constraints, sequence.ordered)
    return replace(problem, maneuver=maneuver)


def at_any_time(stage: Stage) -> Stage:
    """The stage without a window or an instant."""
    return replace(stage, at="free", interval_offset=0)


def with_half_the_thrust(stage: Stage) -> Stage:
    """The stage with half of each thrust that it asks at least."""
    attitude = stage.attitude
    return replace(
        stage,
        conditions=tuple(map(_with_half_the_thrust, stage.conditions)),
        min_upright_thrust=None if stage.min_upright_thrust is None else HALF * stage.min_upright_thrust,
        attitude=None if attitude is None else replace(attitude, min_thrust=HALF * attitude.min_thrust),
    )


def _with_half_the_thrust(condition: Condition) -> Condition:
    if condition.min_thrust <= 0.0:
        return condition
    lower = HALF * condition.lower if condition.lower > 0.0 else condition.lower
    upper = HALF * condition.upper if condition.upper < 0.0 else condition.upper
    return replace(condition, lower=lower, upper=upper)
