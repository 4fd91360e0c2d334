"""The task of a search for a plan that passes: variants of the plain plan, and their shares of flights."""

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
from aerobat.simulation.nested import joined
from aerobat.studies.flights import FlightTask, fly_scores, passed
from aerobat.studies.share import Share
from aerobat.studies.workers import Pool
from aerobat.vehicle import Vehicle

SCREENING_FLIGHTS = 200  # flights after which a plan is rejected if they already refute its probability
# Fractions of the plain plan's largest body rate that limit tightened plans. Rotors with an unknown lag are
# late by an angle proportional to the body rate. With half the body rate, flips of five vehicles took at most
# 2 % longer, with a fifth as many attitude failures; a third of it gained nothing more (lab book).
BODY_RATE_FRACTIONS = (1.0, 0.8, 0.65, 0.5)
REFINEMENT_PLANNER = "free-knots"  # planner that continues from a plan where the requested planner cannot
KEPT_SETTINGS = ("segments", "clearance", "time_limit")  # settings taken from the requested planner


@dataclass(frozen=True)
class Variant:
    """A kind of tightening beside the reserve."""

    body_rate_fraction: float  # [-] limit of body rate, as a fraction of the plain plan's largest
    warm_start: bool  # True: warm start from the plain plan; false: the planner starts anew


VARIANTS = (
    *(Variant(fraction, True) for fraction in BODY_RATE_FRACTIONS),
    *(Variant(fraction, False) for fraction in BODY_RATE_FRACTIONS[::2]),
)


@dataclass(frozen=True, eq=False)
class PassingTask:
    """Problem, vehicle and flights of the search for a plan that passes."""

    problem: Problem
    planner: Any  # a planner with a reserve
    vehicle: Vehicle
    conditions: Dispersion
    seed: int
    controller: str
    probability: float
    progress: Callable[[Attempt], None] | None
    flying: Pool

    def tightened(
        self, plain: Plan, reserve: float, variant: Variant, problem: Problem, limit: float
    ) -> Plan:
        """Return a variant of the plan with a reserve, judged by the task's own problem and vehicle.

        Planning is limited to `limit` [s] of processor time.
        """
        vehicle = self.vehicle
        if variant.body_rate_fraction < 1.0 and plain.assessment is not None:
            vehicle = replace(
                vehicle, max_body_rate=variant.body_rate_fraction * (plain.assessment.max_body_rate or inf)
            )
        planner = self._warm_started(plain, reserve) if variant.warm_start else self._cold_started(reserve)
        with within_time(limit, processor):
            found = plan(problem, planner, vehicle, self.progress)
        return replace(found, problem=self.problem, vehicle=self.vehicle)

    def _warm_started(self, start: Plan, reserve: float) -> Planner:
        """Return the planner, or else the refinement, with a reserve and warm-started from a plan."""
        if hasattr(self.planner, "start"):
            return cast(Planner, replace(self.planner, reserve=reserve, start=start))
        return warm_started_refinement(self.planner, start, reserve)

    def _cold_started(self, reserve: float) -> Planner:
        """Return the planner with a reserve, without a rescue by another planner."""
        own = {"rescue": False} if hasattr(self.planner, "rescue") else {}
        return cast(Planner, replace(self.planner, reserve=reserve, **own))

    def scores(self, found: Plan, flights: range, conditions: Dispersion | None = None) -> Score:
        """Return scores of flights of a plan, by default under the task's conditions."""
        controller = named_controller(self.controller, self.vehicle.controller)
        task = FlightTask(found, self.vehicle, conditions or self.conditions, self.seed, controller)
        return fly_scores(self.flying, (task,), flights)[0]

    def training(self, found: Plan, flights: range) -> Score:
        """Return scores of the training flights, or of the first ones if they refute the probability."""
        first = self.scores(found, flights[:SCREENING_FLIGHTS])
        if len(flights) <= SCREENING_FLIGHTS or passed(first).interval[1] < self.probability:
            return first
        return joined([first, self.scores(found, flights[SCREENING_FLIGHTS:])])

    def share(self, found: Plan, flights: range, conditions: Dispersion | None = None) -> Share:
        """Return the share of flights of a plan that pass."""
        return passed(self.scores(found, flights, conditions))

    def is_proof(self, share: Share) -> bool:
        """Return True where this share proves the probability."""
        return share.interval[0] >= self.probability

    def is_likely_proof(self, share: Share) -> bool:
        """True where the share proves the probability even with one standard deviation fewer passes."""
        deviation = sqrt(share.of * share.fraction * (1.0 - share.fraction))
        return self.is_proof(Share(max(share.count - ceil(deviation), 0), share.of))


def warm_started_refinement(planner: Any, start: Plan, reserve: float) -> Planner:
    """Return the refinement, warm-started from a plan, with the settings of the planner that found it."""
    kept = {name: getattr(planner, name) for name in KEPT_SETTINGS if hasattr(planner, name)}
    return planner_with_reserve(REFINEMENT_PLANNER, reserve, start=start, **kept)
