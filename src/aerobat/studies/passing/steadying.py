"""A plan as fast as the one that was found first, of which more flights succeed: what commands look for.

Rotors that lag otherwise than known are late, by the more degrees the faster a vehicle turns. Paths that turn
much slower often take hardly longer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import radians

from aerobat.control import named_controller
from aerobat.declaration import Seed, validated
from aerobat.environment import Dispersion, as_dispersion
from aerobat.errors import Infeasible, SpecError
from aerobat.evaluation import Score
from aerobat.optimization.deadline import out_of_time, processor, within_time
from aerobat.planning import Attempt, Plan, Planner
from aerobat.problem import Problem
from aerobat.studies.flights import FlightTask, fly_scores
from aerobat.studies.passing.spread import narrowed
from aerobat.studies.passing.task import calmed, going_on, passed
from aerobat.studies.workers import pool

LATE = radians(15.0)  # that a vehicle turns while its rotors lag: from there on some flights come too late
CALMS = (0.65, 0.5, 0.8)  # of the largest body rate (benchmarks/steadying.py)
LONGEST = 1.01  # times the duration of the plan that was found first
CHOOSING = range(10**6, 10**6 + 200)  # the flights that choose: others judge
ENOUGH = 0.975  # of these flights: most plans of which so many succeed are proven for 95 %
WORTH = 0.4  # of these flights: where fewer succeed, turning slower has not helped
TRYING_TIME = 30.0  # [s] of the processor for these plans and flights, which take 1 to 10: no clock decides


@validated
def steadied(
    plan: Plan,
    planner: Planner,
    conditions: Dispersion | str = "lab",
    *,
    seed: Seed = 0,
    controller: str = "full",
    progress: Callable[[Attempt], None] | None = None,
) -> Plan:
    """Return the plan, or one at most a hundredth longer that turns slower and of which more flights succeed.

    It is looked for where gates are passed, the rotors' lag tells, and too few of some flights succeed.

    Args:
        plan: What was found first, for a vehicle.
        planner: What found it.
        conditions: Under which flights are flown, or their name.
        seed: Of the flights.
        controller: The name of what flies them.
        progress: Called with every attempt.
    """
    vehicle = plan.vehicle
    reserve = getattr(planner, "reserve", 0.0)
    if vehicle is None or plan.assessment is None or not (reserve and plan.problem.gates and plan.flies):
        return plan
    turned = float(vehicle.lags.max()) * (plan.assessment.max_body_rate or 0.0)
    if turned <= LATE:
        return plan
    dispersion, law = as_dispersion(conditions), named_controller(controller, vehicle.controller)
    with pool(1, None, 1) as flying, within_time(TRYING_TIME, processor):

        def flown(each: Plan) -> Score:
            task = FlightTask(each, vehicle, dispersion, seed, law)
            return fly_scores(flying, (task,), CHOOSING)[0]

        first = flown(plan)
        share = best = passed(first)
        if not WORTH <= share.fraction < ENOUGH:
            return plan
        found = plan
        for other, calm in _calmer(plan, planner, narrowed(plan.problem, vehicle, first), progress):
            succeed = passed(flown(other))
            if succeed.count > best.count:
                why = (
                    f"goes on from {plan.planner}'s {plan.duration:.3f} s, turning at most {100 * calm:g} % "
                    f"as fast: {succeed.count} of {succeed.of} flights succeed instead of {share.count}"
                )
                attempts = (*plan.attempts, *other.attempts)
                best, found = succeed, replace(other, attempts=attempts, rescue=why)
            if best.fraction >= ENOUGH:
                break
    return found


def _calmer(
    plan: Plan, planner: Planner, problem: Problem, progress: Callable[[Attempt], None] | None
) -> Iterator[tuple[Plan, float]]:
    """Yield plans that are hardly longer, certified and fly, with the part of the body rate that is left."""
    reserve = getattr(planner, "reserve", 0.0)
    goes_on = going_on(planner, plan, reserve if plan.keeps(reserve) else 0.0)
    for calm in CALMS:
        if out_of_time():
            return
        try:
            found = calmed(plan, calm, goes_on, problem, progress)
        except (Infeasible, SpecError):  # no plan, or gates too narrow for one
            continue
        if found.duration <= LONGEST * plan.duration and found.certified and found.flies:
            yield found, calm
