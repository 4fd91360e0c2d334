"""Evidence that takes seconds and is computed on request: another planner's answer, and recoveries."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from aerobat.declaration import validated
from aerobat.errors import Infeasible, SpecError
from aerobat.optimization.deadline import out_of_time, within_time
from aerobat.planning.assessment.assessment import SecondOpinion
from aerobat.planning.planners import planner_class
from aerobat.planning.recorder import Progress
from aerobat.planning.result import FLYING_RESERVE, Plan, reserve_kept
from aerobat.simulation.autopilot import UndeterminedAttitude, recoveries

OPINION = "free-knots"  # the planner that gives second opinions
OPINION_RESERVE = 0.03  # least reserve of its plan, as a fraction of limits' ranges, for small disturbances
OPINION_TIME = 20.0  # time limit [s]: from a poor plan of a long course, free-knots would take an hour


@validated
def with_second_opinion(plan: Plan, progress: Progress | None = None) -> Plan:
    """Return the plan, with the answer of free-knots to the same problem if the plan is suspicious.

    The planner free-knots starts from the plan, and keeps as much reserve as the plan was to keep. It takes
    seconds, OPINION_TIME at most, and no more than is left of a time limit
    (`optimization.deadline.within_time`); the best plan by then counts. Plans of time-optimal, and plans
    that a time limit ended, get no second opinion.
    Raises SpecError without a vehicle.

    Args:
        plan: A plan for a vehicle.
        progress: A function that is called with every attempt as it ends.
    """
    _require_vehicle(plan)
    if not plan.wants_second_opinion:
        return plan
    with within_time(OPINION_TIME):
        return replace(plan, opinion=_second_opinion(plan, progress))


def with_recoveries(plan: Plan) -> Plan:
    """Return the plan with its recoveries to a hover; unchanged if its attitude is undetermined.

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
    """Return the plan with a second opinion, where it is suspicious, and with its recoveries.

    Raises SpecError without a vehicle.

    Args:
        plan: A plan for a vehicle.
        progress: A function that is called with every attempt of the second opinion as it ends.
    """
    return with_recoveries(with_second_opinion(plan, progress))


def _second_opinion(plan: Plan, progress: Progress | None) -> SecondOpinion:
    """Return the second opinion, with the duration of a shorter plan that is certified and flies, if any."""
    free_knots: Any = planner_class(OPINION)
    reserve = max(reserve_kept(plan, plan.reserve), OPINION_RESERVE)
    planner, shorter = free_knots(start=plan, reserve=reserve), None
    try:
        found = planner.plan(plan.problem, plan.vehicle, progress)
        if found.certified and found.duration < plan.duration and found.flies:
            shorter = found.duration
    except (Infeasible, SpecError):
        pass
    missing = "the time was over" if shorter is None and out_of_time() else ""
    other = "" if reserve == FLYING_RESERVE else f" --reserve {reserve:g}"
    return SecondOpinion(f"--planner {OPINION}{other}", shorter, missing)


def _require_vehicle(plan: Plan) -> None:
    if plan.vehicle is None:
        raise SpecError("a plan without a vehicle is not flown and has no limits; plan it for one")
