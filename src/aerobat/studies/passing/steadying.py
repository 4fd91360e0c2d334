"""A plan with more successful flights than the first one, where that is worth its time: used by commands.

The search goes on from its best plan, with one more requirement at a time, until enough flights succeed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import log, radians

from aerobat.declaration import Seed, validated
from aerobat.environment import Dispersion, as_dispersion
from aerobat.errors import Infeasible, SpecError
from aerobat.optimization.deadline import out_of_time, within_time, work
from aerobat.planning import Attempt, Plan, Planner, as_planner
from aerobat.planning.result import FLYING_RESERVE, reserve_kept
from aerobat.problem import Problem
from aerobat.simulation.nested import joined
from aerobat.studies.flights import LOOKS, passed
from aerobat.studies.passing.spread import with_more_thrust, with_narrower_gates
from aerobat.studies.passing.task import FlownPlan, PassingTask, warm_started_refinement
from aerobat.studies.passing.tightening import Tightening, rounds
from aerobat.studies.share import Trials
from aerobat.studies.workers import Pool

MAX_LAG_ANGLE = radians(5.0)  # [rad] turned within the rotors' lag, above which flights may be too late
SELECTION_FLIGHTS = range(10**6, 10**6 + 400)  # flights that select the plan; other flights judge it
FIRST_FLIGHTS = 50  # of these: where enough of them succeed, the plan is kept
MIN_GAIN = 0.02  # fraction of these flights that must succeed beyond the first plan's for a longer plan
# price of a duration e times as long, as a fraction of these flights: of a plan 10 % longer, 5 of 100 flights
# more must succeed
DURATION_PRICE = 0.5
TRIES = 12  # further plans that are tried by commands
PLANNING_WORK = 4.0  # work limit [s] of each of them; most take 0.3 to 3
SEARCH_WORK = 15.0  # work [s] after which commands try no further plan; most searches take 1 to 7


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
    """Return the plan, or another one of which more flights succeed, if that is worth its longer duration.

    The other has lower body rates, more reserve, or more thrust in stages that flights pass with a wrong
    attitude. A duration 10 % longer is worth 5 of 100 flights. More reserve is tried only where the planner
    has the default reserve. Other plans are searched only if the rotors' lag matters, and too few of some
    flights succeed.

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
    if vehicle is None or plan.assessment is None or not (reserve and plan.flies):
        return plan
    if float(vehicle.lags.max()) * (plan.assessment.max_body_rate or 0.0) <= MAX_LAG_ANGLE:
        return plan
    kept = reserve_kept(plan, reserve)
    task = PassingTask(
        problem=plan.problem,
        planner=warm_started_refinement(planner, plan, kept),
        vehicle=vehicle,
        conditions=as_dispersion(conditions),
        seed=seed,
        controller=controller,
        probability=Trials.NEEDED,
        flights=SELECTION_FLIGHTS,
        proving=LOOKS[-1],
        planning_work=PLANNING_WORK,
        progress=progress,
        flying=Pool(),
    )
    scores = task.scores(plan, SELECTION_FLIGHTS[:FIRST_FLIGHTS])
    if task.suffices(passed(scores)):
        return plan
    scores = joined([scores, task.scores(plan, SELECTION_FLIGHTS[FIRST_FLIGHTS:])])
    first = FlownPlan(plan, scores, kept, plan.problem)
    with within_time(SEARCH_WORK, work):
        found = steadier(task, first, first, TRIES, DURATION_PRICE, may_grow=reserve == FLYING_RESERVE)
    return plan if found is first else _explained(found, first)


def steadier(
    task: PassingTask, first: FlownPlan, start: FlownPlan, tries: int, price: float, may_grow: bool = True
) -> FlownPlan:
    """Return the most valuable of some plans of which more flights succeed, or the plan at the start.

    Each round of steps goes on from the most valuable plan so far. The search ends when enough flights
    succeed.

    Args:
        task: The flights, and the planner of further plans.
        first: The first plan, from which longer durations have their price.
        start: The plan at the start.
        tries: The largest number of further plans.
        price: The price of a duration e times as long, as a fraction of the flights.
        may_grow: Whether larger reserves are tried, too.
    """

    def price_of(plan: Plan) -> float:
        return price * log(plan.duration / first.plan.duration)

    best, most = start, start.share.fraction - price_of(start.plan)
    too_long: list[Tightening] = []  # whose plans are not worth their duration
    base, last = best, tuple[Tightening, ...]()
    for steps in rounds(task.problem, may_grow):
        if best is base and steps == last:  # which would find the same
            continue
        base, last = best, steps
        for step in steps:
            if not tries or out_of_time() or task.suffices(best.share):
                return best
            tightening, required = base.tightening.then(step), _required(task, base, step.thrust)
            if any(tightening.contains(each) for each in too_long):
                continue
            if step.thrust and required.maneuver == base.required.maneuver:  # no more would help
                continue
            tries -= 1
            try:
                plan = task.tightened(first, base, tightening, required)
            except (Infeasible, SpecError):  # no plan, or gates too narrow for one
                continue
            if 1.0 - price_of(plan) <= most:
                too_long.append(tightening)
            elif plan.certified and plan.flies:
                flown = FlownPlan(plan, task.selecting(plan), first.first_reserve, required, tightening)
                task.note(flown)
                share = flown.share
                value = share.fraction - price_of(plan)
                least = start.share.fraction + MIN_GAIN * (price_of(plan) > 0.0)
                if value > most and share.fraction > least:
                    best, most = flown, value
    return best


def _required(task: PassingTask, best: FlownPlan, more_thrust: bool) -> Problem:
    """Return the problem of a further plan: gates narrowed by flights, and thrust in stages as required."""
    narrower = with_narrower_gates(task.problem, task.vehicle, best.scores)
    narrower = replace(narrower, maneuver=best.required.maneuver)
    if not more_thrust:
        return narrower
    fraction = 0.5 * (1.0 + task.probability)  # half of the flights that may fail
    return with_more_thrust(narrower, task.vehicle, best.plan, best.scores, fraction)


def _explained(found: FlownPlan, first: FlownPlan) -> Plan:
    """Return the found plan with its relation to the first one as its `rescue`."""
    why = (
        f"goes on from {first.plan.planner}'s {first.plan.duration:.3f} s"
        f"{found.tightening.described(first.reserve)}: {found.share.count} of {found.share.of} "
        f"flights succeed instead of {first.share.count} of {first.share.of}"
    )
    attempts = (*first.plan.attempts, *found.plan.attempts)
    return replace(found.without_second_opinion, attempts=attempts, rescue=why)
