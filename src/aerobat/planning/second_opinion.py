"""Evidence on a plan that takes seconds, on request: another planner's answer, and the plan's recoveries."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from aerobat.declaration import validated
from aerobat.errors import Infeasible, SpecError
from aerobat.optimization.deadline import out_of_time, within_time
from aerobat.planning.assessment.assessment import SecondOpinion
from aerobat.planning.planners import planner_class
from aerobat.planning.recorder import Progress
from aerobat.planning.result import Plan
from aerobat.simulation.autopilot import UndeterminedAttitude, recoveries

OPINION = "free-knots"
OPINION_RESERVE = 0.03  # of every limit's range, that a shorter plan keeps: it flies, if little disturbs it
OPINION_TIME = 20.0  # [s] at most: a poor plan of a long course would keep free knots busy for an hour


@validated
def with_second_opinion(plan: Plan, progress: Progress | None = None) -> Plan:
    """The plan; where its assessment finds it suspicious, with what free knots make of the same problem.

    They begin from the plan. That takes seconds, OPINION_TIME at most, and no more than is left of a limit
    (`optimization.deadline.within_time`); what they found by then counts. Time-optimal plans need none, and
    a plan that a limit ended gets none.
    Raises SpecError without a vehicle.

    Args:
        plan: For a vehicle.
        progress: Called with every attempt as it ends.
    """
    _require_vehicle(plan)
    if not plan.wants_second_opinion:
        return plan
    with within_time(OPINION_TIME):
        return replace(plan, opinion=_second_opinion(plan, progress))


def with_recoveries(plan: Plan) -> Plan:
    """The plan for a vehicle with its recoveries to a hover; without where its attitude is undetermined.

    Raises SpecError without a vehicle.
    """
    _require_vehicle(plan)
    if plan.recoveries is not None:
        return plan
    try:
        return replace(plan, recoveries=recoveries(plan))
    except UndeterminedAttitude:
        return plan


def with_explanation(plan: Plan, progress: Progress | None = None) -> Plan:
    """The plan with what takes seconds to know: a second opinion, where it wants one, and its recoveries.

    Raises SpecError without a vehicle.

    Args:
        plan: For a vehicle.
        progress: Called with every attempt of the second opinion as it ends.
    """
    return with_recoveries(with_second_opinion(plan, progress))


def _second_opinion(plan: Plan, progress: Progress | None) -> SecondOpinion:
    """A shorter plan by free knots that is certified and flies, if there is one."""
    free_knots: Any = planner_class(OPINION)
    planner, shorter = free_knots(start=plan, reserve=OPINION_RESERVE), None
    try:
        found = planner.plan(plan.problem, plan.vehicle, progress)
        if found.certified and found.duration < plan.duration and found.flies:
            shorter = found.duration
    except (Infeasible, SpecError):
        pass
    missing = "the time was over" if shorter is None and out_of_time() else ""
    return SecondOpinion(f"--planner {OPINION}", shorter, missing)


def _require_vehicle(plan: Plan) -> None:
    if plan.vehicle is None:
        raise SpecError("a plan without a vehicle is not flown and has no limits; plan it for one")
