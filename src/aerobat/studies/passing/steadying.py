"""A plan with more successful flights than the first one, where that is worth its time: used by commands.

Rotors with an unknown lag are late by an angle proportional to the body rate. Paths with much lower body
rates often take hardly longer. A push that no model contains, such as unknown drag, tilts the vehicle by the
ratio of push to thrust, so that more thrust in a gate keeps the attitude there. A larger reserve of every
rotor leaves more to the controller.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import log, radians

from aerobat.declaration import Seed, validated
from aerobat.environment import Dispersion, as_dispersion
from aerobat.errors import Infeasible, SpecError
from aerobat.optimization.deadline import processor
from aerobat.planning import Attempt, Plan, Planner, as_planner
from aerobat.planning.result import FLYING_RESERVE
from aerobat.problem import Problem
from aerobat.simulation.nested import joined
from aerobat.studies.flights import passed
from aerobat.studies.passing.spread import with_more_thrust, with_narrower_gates
from aerobat.studies.passing.task import PassingTask, Variant, warm_started_refinement
from aerobat.studies.share import Share, Trials
from aerobat.studies.workers import Pool

MAX_LAG_ANGLE = radians(5.0)  # [rad] turned within the rotors' lag, above which flights may be too late
SELECTION_FLIGHTS = range(10**6, 10**6 + 200)  # flights that select the plan; other flights judge it
FIRST_FLIGHTS = 50  # of these: where enough of them succeed, the plan is kept
SUFFICIENT_SUCCESS = 0.975  # fraction of these flights: most plans with as many successes are proven for 95 %
CERTAIN_SUCCESS = 0.985  # likewise, less the price of the duration, with which no further plan is tried
MIN_GAIN = 0.02  # fraction of these flights that must succeed beyond the first plan's for a longer plan
# price of a duration e times as long, as a fraction of these flights: of a plan 10 % longer, 5 of 100 flights
# more must succeed
DURATION_PRICE = 0.5
PLANNING_TIME = 6.0  # [s] processor time limit of all these plans, most of which take 0.3 to 3
PLAN_FRACTION = 0.6  # fraction of the time that is left for one of them
LEAST_TIME = 0.5  # [s] of which no plan is begun with less


@dataclass(frozen=True)
class _Tightening:
    """What is asked of a further plan."""

    rate: float  # limit of the body rate, as a fraction of the first plan's largest; 1 only refines once more
    reserve: float = 0.0  # beyond the first plan's
    thrust: bool = False  # whether more thrust is asked in gates

    def contains(self, other: _Tightening) -> bool:
        """Return True where whatever the other asks is asked here too."""
        return self.rate <= other.rate and self.reserve >= other.reserve and self.thrust >= other.thrust

    def described(self, reserve: float) -> str:
        """Return the differences from the first plan in words, whose reserve is given."""
        stronger = ", with more thrust in gates" if self.thrust else ""
        slower = "" if self.rate == 1.0 else f", turning at most {100 * self.rate:g} % as fast"
        kept = f", with a reserve of {reserve + self.reserve:g}" if self.reserve else ""
        return stronger + slower + kept


# In the order of trial. Lower body rates cost flips through gates hardly any time, and more thrust keeps
# their attitude; of figures without gates more reserve costs the least time (benchmarks/steadying.py).
_TIGHTENINGS = (
    _Tightening(1.0),
    *(_Tightening(rate, thrust=thrust) for rate in (0.65, 0.5) for thrust in (False, True)),
    *(_Tightening(1.0, reserve, thrust) for reserve in (0.1, 0.2) for thrust in (False, True)),
    *(_Tightening(0.8, reserve) for reserve in (0.0, 0.1)),
)


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
    kept = reserve if plan.keeps(reserve) else 0.0
    task = PassingTask(
        problem=plan.problem,
        planner=warm_started_refinement(planner, plan, kept),
        vehicle=vehicle,
        conditions=as_dispersion(conditions),
        seed=seed,
        controller=controller,
        probability=Trials.NEEDED,
        progress=progress,
        flying=Pool(),
    )
    return steadier(task, plan, kept, may_grow=reserve == FLYING_RESERVE)[0]


@dataclass(frozen=True)
class _Candidate:
    """A plan, and the share of its flights that succeed."""

    plan: Plan
    share: Share
    tightening: _Tightening  # what is asked of it, beyond the first plan
    price: float = 0.0  # of its duration, as a fraction of the flights

    @property
    def value(self) -> float:
        """The fraction of the flights that succeed, less the price of the duration."""
        return self.share.fraction - self.price

    def explained(self, first: _Candidate, reserve: float) -> Plan:
        """Return the plan with its relation to the first plan, which keeps a reserve, as its `rescue`."""
        why = (
            f"goes on from {first.plan.planner}'s {first.plan.duration:.3f} s"
            f"{self.tightening.described(reserve)}: {self.share.count} of {self.share.of} flights succeed "
            f"instead of {first.share.count}"
        )
        return replace(self.plan, attempts=(*first.plan.attempts, *self.plan.attempts), rescue=why)


def steadier(task: PassingTask, plan: Plan, reserve: float, may_grow: bool) -> tuple[Plan, float]:
    """Return the most valuable of some plans of which more flights succeed, or the plan; and its reserve.

    Args:
        task: The flights, and the planner of further plans.
        plan: The first plan.
        reserve: The reserve that the first plan keeps.
        may_grow: Whether larger reserves are tried, too.
    """
    scores = task.scores(plan, SELECTION_FLIGHTS[:FIRST_FLIGHTS])
    if passed(scores).fraction >= SUFFICIENT_SUCCESS:
        return plan, reserve
    scores = joined([scores, task.scores(plan, SELECTION_FLIGHTS[FIRST_FLIGHTS:])])
    share = passed(scores)
    if share.fraction >= SUFFICIENT_SUCCESS:
        return plan, reserve
    first = best = _Candidate(plan, share, _Tightening(1.0))
    deadline = processor() + PLANNING_TIME
    narrower = with_narrower_gates(plan.problem, task.vehicle, scores)
    stronger = with_more_thrust(narrower, task.vehicle, plan, scores, SUFFICIENT_SUCCESS)
    too_long: list[_Tightening] = []  # whose plans are not worth their duration
    for each in _tightenings(plan.problem, may_grow, stronger != narrower):
        left = deadline - processor()
        if best.value >= CERTAIN_SUCCESS or left <= LEAST_TIME:
            break
        if any(each.contains(other) for other in too_long):
            continue
        problem, variant = stronger if each.thrust else narrower, Variant(each.rate, True)
        try:
            other = task.tightened(plan, reserve + each.reserve, variant, problem, PLAN_FRACTION * left)
        except (Infeasible, SpecError):  # no plan, or gates too narrow for one
            continue
        price = DURATION_PRICE * log(other.duration / plan.duration)
        if 1.0 - price <= best.value:
            too_long.append(each)
        elif other.certified and other.flies:
            flown = _Candidate(other, passed(task.scores(other, SELECTION_FLIGHTS)), each, price)
            least = first.share.fraction + (MIN_GAIN if price > 0.0 else 0.0)
            if flown.value > best.value and flown.share.fraction > least:
                best = flown
    if best is first:
        return plan, reserve
    return best.explained(first, reserve), reserve + best.tightening.reserve


def _tightenings(problem: Problem, may_grow: bool, may_push: bool) -> list[_Tightening]:
    """Return the tightenings that are tried; larger reserves and more thrust in gates only where they may be.

    Without gates only larger reserves are tried, if they may be.
    """
    allowed = [
        each
        for each in _TIGHTENINGS
        if (may_grow or not each.reserve) and (not each.thrust or (may_push and problem.gates))
    ]
    larger = [each for each in allowed if each.reserve]
    return allowed if problem.gates or not larger else larger
