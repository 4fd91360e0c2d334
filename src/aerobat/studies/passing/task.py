"""One plan that is to pass: a variant of the plain one, and the shares of its flights that pass."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil, inf, sqrt
from typing import Any, cast

from aerobat.control import named_controller
from aerobat.environment import Dispersion
from aerobat.evaluation import Score
from aerobat.optimization.deadline import processor, within_time
from aerobat.planning import Attempt, Plan, Planner, plan
from aerobat.planning.planners import planner_with_reserve
from aerobat.problem import Problem
from aerobat.studies.flights import FlightTask, fly_scores, joined, passed
from aerobat.studies.share import Share
from aerobat.studies.workers import Pool
from aerobat.vehicle import Vehicle

SCREENED = 200  # flights after which a plan is given up whose share is refuted by then
# fractions of the plain plan's largest body rate, to which tightened ones keep: rotors that lag otherwise
# than known are late, by the more degrees the faster a vehicle turns. Half the body rate made flips of five
# vehicles at most 2 % longer, with a fifth as many off their attitude; a third gained nothing (lab book)
CALMS = (1.0, 0.8, 0.65, 0.5)
REFINING = "free-knots"  # the planner that goes on from a plan where the one asked for cannot
KEPT = ("segments", "clearance", "time_limit")  # of the settings of the one asked for


@dataclass(frozen=True)
class Variant:
    """Kind of tightening, beside the reserve."""

    calm: float  # [-] of the plain plan's largest body rate, that is left
    goes_on: bool  # from the plain plan; else the planner begins anew


VARIANTS = (*(Variant(calm, True) for calm in CALMS), *(Variant(calm, False) for calm in CALMS[::2]))


@dataclass(frozen=True, eq=False)
class PassingTask:
    """Problem, vehicle and flights of a plan that is to pass."""

    problem: Problem
    planner: Any  # a planner with a reserve
    vehicle: Vehicle
    conditions: Dispersion
    seed: int
    controller: str
    probability: float
    progress: Callable[[Attempt], None] | None
    flying: Pool

    def plain(self) -> Plan:
        """The plan as the planner finds it."""
        return plan(self.problem, self.planner, self.vehicle, self.progress)

    def tightened(
        self, plain: Plan, reserve: float, variant: Variant, problem: Problem, limit: float
    ) -> Plan:
        """A variant of the plan with a reserve, judged by the task's own problem and vehicle.

        It is found within `limit` [s] of the processor.
        """
        vehicle = self.vehicle
        if variant.calm < 1.0 and plain.assessment is not None:
            vehicle = replace(vehicle, max_body_rate=variant.calm * (plain.assessment.max_body_rate or inf))
        planner = self._from(plain, reserve) if variant.goes_on else self._anew(reserve)
        with within_time(limit, processor):
            found = plan(problem, planner, vehicle, self.progress)
        return replace(found, problem=self.problem, vehicle=self.vehicle)

    def _from(self, start: Plan, reserve: float) -> Planner:
        """The planner with a reserve, or for one that takes no start, the refinement from a plan on."""
        if hasattr(self.planner, "start"):
            return cast(Planner, replace(self.planner, reserve=reserve, start=start))
        return going_on(self.planner, start, reserve)

    def _anew(self, reserve: float) -> Planner:
        """The planner with a reserve, and no other in its place."""
        own = {"rescue": False} if hasattr(self.planner, "rescue") else {}
        return cast(Planner, replace(self.planner, reserve=reserve, **own))

    def scores(self, found: Plan, flights: range, conditions: Dispersion | None = None) -> Score:
        """Scores of flights of a plan, by default under the task's conditions."""
        controller = named_controller(self.controller, self.vehicle.controller)
        task = FlightTask(found, self.vehicle, conditions or self.conditions, self.seed, controller)
        return fly_scores(self.flying, (task,), flights)[0]

    def training(self, found: Plan, flights: range) -> Score:
        """Scores of the training flights; of the first ones alone where these refute the probability."""
        first = self.scores(found, flights[:SCREENED])
        if len(flights) <= SCREENED or passed(first).interval[1] < self.probability:
            return first
        scores: Score = joined([first, self.scores(found, flights[SCREENED:])])
        return scores

    def share(self, found: Plan, flights: range, conditions: Dispersion | None = None) -> Share:
        """The share of flights of a plan that pass."""
        return passed(self.scores(found, flights, conditions))

    def is_enough(self, share: Share) -> bool:
        """True where this share of the flights proves the probability."""
        return share.interval[0] >= self.probability

    def is_likely_enough(self, share: Share) -> bool:
        """True where the probability is proven even if one standard deviation fewer flights pass."""
        deviation = sqrt(share.of * share.fraction * (1.0 - share.fraction))
        return self.is_enough(Share(max(share.count - ceil(deviation), 0), share.of))


def going_on(planner: Any, start: Plan, reserve: float) -> Planner:
    """The refinement from a plan on, with the settings of the planner that found it."""
    kept = {name: getattr(planner, name) for name in KEPT if hasattr(planner, name)}
    return planner_with_reserve(REFINING, reserve, start=start, **kept)
