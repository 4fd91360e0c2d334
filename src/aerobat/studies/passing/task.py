"""The task of a search for a plan that flies better: further plans, their flights, and what suffices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import inf, sqrt
from typing import Any

from aerobat.control import named_controller
from aerobat.environment import Dispersion
from aerobat.evaluation import Score
from aerobat.optimization.deadline import count_work, within_time, work
from aerobat.planning import Attempt, Plan, Planner, SecondOpinion, plan
from aerobat.planning.planners import planner_with_reserve
from aerobat.problem import Problem
from aerobat.simulation.nested import joined
from aerobat.studies.flights import FlightTask, fly_scores, passed
from aerobat.studies.passing.result import Round
from aerobat.studies.passing.tightening import Tightening
from aerobat.studies.share import Share
from aerobat.studies.workers import Pool
from aerobat.vehicle import Vehicle

FLIGHT_WORK = 1e-3  # work of a flight [s], measured (benchmarks/sweep.py)
SCREENING_FLIGHTS = 200  # flights after which a plan is rejected if they already refute its probability


@dataclass(frozen=True, eq=False)
class FlownPlan:
    """A plan, what was required of it, and the scores of its flights."""

    plan: Plan
    scores: Score
    first_reserve: float  # that the first plan keeps
    required: Problem  # the plan's problem, or one with narrower gates or more thrust in its stages
    tightening: Tightening = field(default_factory=Tightening)  # beyond the first plan's requirements

    @property
    def reserve(self) -> float:
        """The reserve of every limit's range that was required [-]."""
        return round(self.first_reserve + self.tightening.reserve, 9)

    @property
    def share(self) -> Share:
        """The share of the flights that succeed."""
        return passed(self.scores)

    @property
    def without_second_opinion(self) -> Plan:
        """The plan, for which no other planner is asked: that would give flights no chance to succeed."""
        if not self.plan.wants_second_opinion:
            return self.plan
        longer = SecondOpinion("", None, "it is longer so that more flights succeed")
        return replace(self.plan, opinion=longer)


@dataclass(frozen=True, eq=False)
class PassingTask:
    """Problem, vehicle and flights of the search for a plan that flies better."""

    problem: Problem
    planner: Any  # a planner with a reserve
    vehicle: Vehicle
    conditions: Dispersion
    seed: int
    controller: str
    probability: float  # with which flights must succeed
    flights: range  # numbers of the flights by which plans are selected
    proving: int  # number of other flights that prove the selected plan
    planning_work: float  # work limit [s] of a further plan
    progress: Callable[[Attempt], None] | None
    flying: Pool
    tried: Callable[[Round], None] | None = None  # called with every round
    rounds: list[Round] = field(default_factory=list)

    def note(self, flown: FlownPlan) -> None:
        """Record a plan and its flights as a round, and report it."""
        found = Round(flown.reserve, flown.plan, flown.share)
        self.rounds.append(found)
        if self.tried is not None:
            self.tried(found)

    def tightened(
        self, first: FlownPlan, start: FlownPlan, tightening: Tightening, required: Problem
    ) -> Plan:
        """Return a plan that goes on from another, judged by the task's own problem and vehicle.

        Args:
            first: The first plan.
            start: The plan that is gone on from.
            tightening: The requirements beyond the first plan's.
            required: The problem to plan.
        """
        vehicle, assessment = self.vehicle, first.plan.assessment
        if tightening.rate < 1.0 and assessment is not None:
            vehicle = replace(vehicle, max_body_rate=tightening.rate * (assessment.max_body_rate or inf))
        reserve = round(first.first_reserve + tightening.reserve, 9)
        if hasattr(self.planner, "start"):
            planner = replace(self.planner, reserve=reserve, start=start.plan)
        else:
            planner = warm_started_refinement(self.planner, start.plan, reserve)
        with within_time(self.planning_work, work):
            found = plan(required, planner, vehicle, self.progress)
        return replace(found, problem=self.problem, vehicle=self.vehicle)

    def scores(self, found: Plan, flights: range, conditions: Dispersion | None = None) -> Score:
        """Return scores of flights of a plan, by default under the task's conditions."""
        controller = named_controller(self.controller, self.vehicle.controller)
        task = FlightTask(found, self.vehicle, conditions or self.conditions, self.seed, controller)
        count_work(FLIGHT_WORK * len(flights))
        return fly_scores(self.flying, (task,), flights)[0]

    def selecting(self, found: Plan) -> Score:
        """Return scores of the selecting flights, or of the first ones if they refute the probability."""
        first = self.scores(found, self.flights[:SCREENING_FLIGHTS])
        if len(self.flights) <= SCREENING_FLIGHTS or passed(first).interval[1] < self.probability:
            return first
        return joined([first, self.scores(found, self.flights[SCREENING_FLIGHTS:])])

    def share(self, found: Plan, flights: range, conditions: Dispersion | None = None) -> Share:
        """Return the share of flights of a plan that pass."""
        return passed(self.scores(found, flights, conditions))

    def is_proof(self, share: Share) -> bool:
        """Return True where this share proves the probability."""
        return share.interval[0] >= self.probability

    def suffices(self, share: Share) -> bool:
        """Return True where the proving flights, one standard deviation below this share, are a proof."""
        fraction = share.fraction
        least = self.proving * fraction - sqrt(self.proving * fraction * (1.0 - fraction))
        return self.is_proof(Share(max(int(least), 0), self.proving))


def warm_started_refinement(planner: Any, start: Plan, reserve: float) -> Planner:
    """Return the refinement, warm-started from a plan, with the settings of the planner that found it."""
    names = ("segments", "clearance", "time_limit")
    kept = {name: getattr(planner, name) for name in names if hasattr(planner, name)}
    return planner_with_reserve("free-knots", reserve, start=start, **kept)
