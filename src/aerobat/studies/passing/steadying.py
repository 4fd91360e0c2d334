"""A plan about as fast as the first one, but with more successful flights: used by commands.

Rotors with an unknown lag are late by an angle proportional to the body rate. Paths with much lower body
rates often take hardly longer. A push that no model contains, such as unknown drag, tilts the vehicle by the
ratio of push to thrust, so that more thrust in a gate keeps the attitude there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import radians

from aerobat.declaration import Seed, validated
from aerobat.environment import Dispersion, as_dispersion
from aerobat.errors import Infeasible, SpecError
from aerobat.evaluation import Score
from aerobat.optimization.deadline import processor
from aerobat.planning import Attempt, Plan, Planner, as_planner
from aerobat.problem import Problem
from aerobat.studies.flights import joined, passed
from aerobat.studies.passing.spread import with_more_thrust, with_narrower_gates
from aerobat.studies.passing.task import PassingTask, Variant, warm_started_refinement
from aerobat.studies.share import Trials
from aerobat.studies.workers import pool

MAX_LAG_ANGLE = radians(5.0)  # [rad] turned within the rotors' lag, above which flights may be too late
# of the largest body rate, in the order of trial (benchmarks/steadying.py); 1 only refines the path once more
BODY_RATE_FRACTIONS = (0.65, 1.0, 0.5, 0.8)
MAX_DURATION_RATIO = 1.03  # longest duration, over that of the first plan
SELECTION_FLIGHTS = range(10**6, 10**6 + 200)  # flights that select the plan; other flights judge it
FIRST_FLIGHTS = 50  # of these: where enough of them succeed, the plan is kept
SUFFICIENT_SUCCESS = 0.975  # fraction of these flights: most plans with as many successes are proven for 95 %
CERTAIN_SUCCESS = 0.985  # fraction of these flights with which no further plan is tried
MIN_GAIN = 0.02  # fraction of these flights that must succeed beyond the best so far for a longer plan
# [s] processor time limit of all these plans, most of which take 0.3 to 1; each may take half of what is left
PLANNING_TIME = 4.0
LEAST_TIME = 0.5  # [s] of which no plan is begun with less


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
    """Return the plan, or one at most 3 % longer of which more flights succeed.

    It has lower body rates, and more thrust in gates that flights pass with a wrong attitude. Others are
    searched only if there are gates, the rotors' lag matters, and too few of some flights succeed.

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
        return _steadier(task, plan, kept)


def _steadier(task: PassingTask, plan: Plan, reserve: float) -> Plan:
    """Return the plan, or one with more thrust in gates or lower body rates of which more flights succeed."""
    scores = task.scores(plan, SELECTION_FLIGHTS[:FIRST_FLIGHTS])
    if passed(scores).fraction >= SUFFICIENT_SUCCESS:
        return plan
    scores = joined([scores, task.scores(plan, SELECTION_FLIGHTS[FIRST_FLIGHTS:])])
    first = best = passed(scores)
    if first.fraction >= SUFFICIENT_SUCCESS:
        return plan
    found, deadline = plan, processor() + PLANNING_TIME
    for problem, how in _tightened(task, plan, scores):
        too_slow = 0.0  # largest fraction of the body rate with which a path took too long
        for rate in BODY_RATE_FRACTIONS:
            left = deadline - processor()
            if best.fraction >= CERTAIN_SUCCESS or left <= LEAST_TIME:
                return found
            if rate <= too_slow:
                continue
            try:
                other = task.tightened(plan, reserve, Variant(rate, True), problem, 0.5 * left)
            except (Infeasible, SpecError):  # no plan, or gates too narrow for one
                continue
            if other.duration > MAX_DURATION_RATIO * plan.duration:
                too_slow = rate
                continue
            if not (other.certified and other.flies):
                continue
            share = passed(task.scores(other, SELECTION_FLIGHTS))
            gain = MIN_GAIN if other.duration > found.duration else 0.0
            if share.fraction > best.fraction + gain:
                slower = "" if rate == 1.0 else f", turning at most {100 * rate:g} % as fast"
                why = (
                    f"goes on from {plan.planner}'s {plan.duration:.3f} s{how}{slower}: {share.count} of "
                    f"{share.of} flights succeed instead of {first.count}"
                )
                attempts = (*plan.attempts, *other.attempts)
                best, found = share, replace(other, attempts=attempts, rescue=why)
    return found


def _tightened(task: PassingTask, plan: Plan, scores: Score) -> Iterator[tuple[Problem, str]]:
    """Yield the problem with more thrust in gates and with narrower gates only, and how each differs."""
    narrower = with_narrower_gates(plan.problem, task.vehicle, scores)
    stronger = with_more_thrust(narrower, task.vehicle, plan, scores, SUFFICIENT_SUCCESS)
    if stronger != narrower:
        yield stronger, ", with more thrust in gates"
    yield narrower, ""
