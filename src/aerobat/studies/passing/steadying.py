"""A plan about as fast as the first one, but with more successful flights: used by commands.

Rotors with an unknown lag are late by an angle proportional to the body rate. Paths with much lower body
rates often take hardly longer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import radians

from aerobat.declaration import Seed, validated
from aerobat.environment import Dispersion, as_dispersion
from aerobat.errors import Infeasible, SpecError
from aerobat.planning import Attempt, Plan, Planner, as_planner
from aerobat.studies.flights import passed
from aerobat.studies.passing.spread import with_narrower_gates
from aerobat.studies.passing.task import PassingTask, Variant, warm_started_refinement
from aerobat.studies.share import Trials
from aerobat.studies.workers import pool

MAX_LAG_ANGLE = radians(15.0)  # [rad] turned within the rotors' lag: above this, some flights are too late
BODY_RATE_FRACTIONS = (0.65, 0.5, 0.8)  # of the largest body rate (benchmarks/steadying.py)
MAX_DURATION_RATIO = 1.01  # longest duration, over that of the first plan
SELECTION_FLIGHTS = range(10**6, 10**6 + 200)  # flights that select the plan; other flights judge it
SUFFICIENT_SUCCESS = 0.975  # fraction of these flights: most plans with as many successes are proven for 95 %
MIN_SUCCESS = 0.4  # fraction of these flights: with fewer successes, turning slower has not helped
PLANNING_TIME = 10.0  # [s] processor time limit of each plan, which takes 0.3 to 3: the limit decides nothing


@validated
def steadied(
    plan: Plan,
    planner: Planner | str,
    conditions: Dispersion | str = "lab",
    *,
    seed: Seed = 0,
    controller: str = "full",
    progress: Callable[[Attempt], None] | None = None,
) -> Plan:
    """Return the plan, or one at most 1 % longer with lower body rates and more successful flights.

    Others are searched only if there are gates, the rotors' lag matters, and too few of some flights succeed.

    Args:
        plan: The first plan, for a vehicle.
        planner: The planner that found it, or its name.
        conditions: Of the flights, or their name.
        seed: Of the flights.
        controller: The name of the controller.
        progress: Called with every attempt.
    """
    planner = as_planner(planner)
    vehicle, reserve = plan.vehicle, getattr(planner, "reserve", 0.0)
    if vehicle is None or plan.assessment is None or not (reserve and plan.problem.gates and plan.flies):
        return plan
    if float(vehicle.lags.max()) * (plan.assessment.max_body_rate or 0.0) <= MAX_LAG_ANGLE:
        return plan
    kept = reserve if plan.keeps(reserve) else 0.0
    with pool(1, None, 1) as flying:
        task = PassingTask(
            problem=plan.problem,
            planner=warm_started_refinement(planner, plan, kept),
            vehicle=vehicle,
            conditions=as_dispersion(conditions),
            seed=seed,
            controller=controller,
            probability=Trials.NEEDED,
            progress=progress,
            flying=flying,
        )
        return _slower_turning(task, plan, kept)


def _slower_turning(task: PassingTask, plan: Plan, reserve: float) -> Plan:
    """Return the plan, or a slower-turning one, hardly longer, if more flights succeed."""
    scores = task.scores(plan, SELECTION_FLIGHTS)
    first = best = passed(scores)
    found = plan
    problem = with_narrower_gates(plan.problem, task.vehicle, scores)
    for rate in BODY_RATE_FRACTIONS if first.fraction >= MIN_SUCCESS else ():
        if best.fraction >= SUFFICIENT_SUCCESS:
            break
        try:
            other = task.tightened(plan, reserve, Variant(rate, True), problem, PLANNING_TIME)
        except (Infeasible, SpecError):  # no plan, or gates too narrow for one
            continue
        if other.duration > MAX_DURATION_RATIO * plan.duration or not (other.certified and other.flies):
            continue
        share = passed(task.scores(other, SELECTION_FLIGHTS))
        if share.count > best.count:
            why = (
                f"goes on from {plan.planner}'s {plan.duration:.3f} s, turning at most {100 * rate:g} % as "
                f"fast: {share.count} of {share.of} flights succeed instead of {first.count}"
            )
            attempts = (*plan.attempts, *other.attempts)
            best, found = share, replace(other, attempts=attempts, rescue=why)
    return found
