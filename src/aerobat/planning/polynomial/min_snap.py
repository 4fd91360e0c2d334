"""The paper's alternative planner (Section V): closed-form polynomials and a line search on their times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from time import perf_counter

import numpy as np

from aerobat.arrays import Array
from aerobat.certification import Certificate
from aerobat.errors import Infeasible, SpecError
from aerobat.planning.feasibility import RotorMargin, rotor_margin
from aerobat.planning.polynomial.knots import first_times, given_at_knots, violated_stage
from aerobat.planning.proof import certificate_for
from aerobat.planning.result import Attempt, PlacedStage, Plan
from aerobat.planning.search import BisectionSearch, GridSearch, Search
from aerobat.problem.problem import Problem
from aerobat.problem.stage import StageSequence
from aerobat.problem.waypoints import Waypoints
from aerobat.trajectory import Trajectory
from aerobat.trajectory.minimum_effort import Rule, minimum_effort
from aerobat.vehicle import Vehicle

ASSUMED_THRUST_TO_WEIGHT = 2.0  # for first times without a vehicle
STEP = 0.1  # [s] of the paper's line search (Section V-D: 12 iterations from 0.5 and 2.0 to 1.6 and 3.1 s)
STEPS = 100
SLOWER = 30.0  # times the first duration, where stretching all segments gives up
FASTER = 0.3  # times the first duration, where it begins


class TimeScaling(StrEnum):
    """Which segments a longer duration lengthens."""

    FIRST = "first"  # all knots shift by as much, as in the paper: the first segment alone lengthens
    ALL = "all"  # every segment by the same factor


@dataclass(frozen=True)
class MinSnap:
    """Closed-form polynomials of degree 2s − 1 through waypoints, at the smallest duration searched.

    With s = 5, the paper's degree 9, the cost is the integral of crackle squared: "minimum snap" in name
    only; s = 4 is minimum snap, s = 3 minimum jerk. Without a `time_scaling`, waypoints that come with their
    times are shifted as in the paper, by 0.1 s at a time; other paths are stretched as a whole. With
    `stop_after` the search ends at that attempt, whether the vehicle can fly it or not (paper, Fig. 10).
    """

    order: int = 5  # s
    rule: Rule = Rule.VARIATIONAL
    time_scaling: TimeScaling | None = None
    search: Search | None = None
    stop_after: int | None = None

    def __post_init__(self) -> None:
        """Check."""
        if self.order not in (3, 4, 5):
            raise SpecError(f"order must be 3 (jerk), 4 (snap) or 5 (crackle), got {self.order}")
        if self.stop_after is not None and self.stop_after < 1:
            raise SpecError(f"stop_after must be a number of attempts, 1 or more, got {self.stop_after}")

    def plan(
        self,
        problem: Problem,
        vehicle: Vehicle | None = None,
        progress: Callable[[Attempt], None] | None = None,
    ) -> Plan:
        """The path at the first duration of the search that the vehicle can fly, certified.

        Without a vehicle, the path at its first times. Raises Infeasible when no duration will do, and
        SpecError for input that makes no sense.
        """
        planning = _Planning.of(self, problem, vehicle, progress)
        first = float(planning.durations.sum())
        if vehicle is None:
            found = planning.attempt(first)
        else:
            found = self._search(planning.time_scaling, first).smallest(planning.attempt)
        if found is None:
            raise Infeasible(planning.why_infeasible(), planning.attempts)
        return planning.result(found)

    def _search(self, stretch: TimeScaling, first: float) -> Search:
        if self.search is not None:
            return self.search
        if stretch is TimeScaling.FIRST or self.stop_after is not None:
            return GridSearch(first, first + STEP * (STEPS - 1), STEPS)
        return BisectionSearch(FASTER * first, SLOWER * first)


@dataclass(frozen=True)
class _Found:
    trajectory: Trajectory
    cost: float
    feasible: bool
    margin: RotorMargin | None
    certificate: Certificate | None


@dataclass
class _Planning:
    """One run of the search: tries durations and keeps the record."""

    config: MinSnap
    problem: Problem
    sequence: StageSequence
    vehicle: Vehicle | None
    gravity: float  # [m/s²]
    given: Array  # (K, s, 3)
    durations: Array  # [s] to begin with, (K - 1,)
    time_scaling: TimeScaling
    progress: Callable[[Attempt], None] | None
    attempts: list[Attempt] = field(default_factory=list)

    @classmethod
    def of(
        cls,
        config: MinSnap,
        problem: Problem,
        vehicle: Vehicle | None,
        progress: Callable[[Attempt], None] | None,
    ) -> _Planning:
        gravity = problem.environment.gravity
        thrust = ASSUMED_THRUST_TO_WEIGHT * gravity if vehicle is None else vehicle.max_specific_thrust
        sequence = problem.stages(thrust)
        given = given_at_knots(problem, sequence, config.order, gravity)
        timed = isinstance(problem.maneuver, Waypoints) and problem.maneuver.times is not None
        stretch = config.time_scaling or (TimeScaling.FIRST if timed else TimeScaling.ALL)
        durations = first_times(problem, given, thrust)
        return cls(config, problem, sequence, vehicle, gravity, given, durations, stretch, progress)

    def attempt(self, duration: float) -> _Found | None:
        """The path at one duration; None unless it meets its stages and the vehicle can fly it."""
        started = perf_counter()
        trajectory = minimum_effort(
            self.given, self._stretched(duration), self.config.rule, self.problem.heading
        )
        found, outcome = self._judged(trajectory)
        spent = perf_counter() - started
        attempt = Attempt(duration, found.feasible, "optimal", outcome, found.cost, 1, spent)
        self.attempts.append(attempt)
        if self.progress is not None:
            self.progress(attempt)
        stopped = len(self.attempts) == self.config.stop_after
        return found if found.feasible or stopped else None

    def _stretched(self, duration: float) -> Array:
        durations = self.durations.copy()
        if self.time_scaling is TimeScaling.ALL:
            return np.asarray(durations * (duration / durations.sum()))
        durations[0] += duration - durations.sum()
        if durations[0] <= 0.0:
            raise SpecError(
                f"search: a duration of {duration:g} s leaves the first segment no time; begin with more"
            )
        return durations

    def _judged(self, trajectory: Trajectory) -> tuple[_Found, str]:
        """Whether a path will do, and why, in a sentence."""
        cost = trajectory.effort(self.config.order)
        missed = violated_stage(self.sequence, trajectory, self.gravity)
        if self.vehicle is None:
            return _Found(trajectory, cost, missed is None, None, None), missed or "feasible"
        margin = rotor_margin(trajectory, self.vehicle, self.problem.environment)
        if missed is not None or not margin.feasible:
            return _Found(trajectory, cost, False, margin, None), missed or str(margin)
        certificate = certificate_for(trajectory, self.problem, self.vehicle)
        outcome = "feasible" if certificate.certified else certificate.why
        return _Found(trajectory, cost, certificate.certified, margin, certificate), outcome

    def why_infeasible(self) -> str:
        """One sentence, from the last attempt, the slowest."""
        longest = max(self.attempts, key=lambda attempt: attempt.duration)
        shortest = min(attempt.duration for attempt in self.attempts)
        remedy = (
            "stretch all segments, or give other times"
            if self.time_scaling is TimeScaling.FIRST
            else "give the waypoints other times or fewer givens, or take the planner free-knots"
        )
        return (
            f"'{self.problem.name}' has no closed-form path that flies at any duration from {shortest:.3g} "
            f"to {longest.duration:.3g} s: at the last, {longest.outcome}; {remedy}"
        )

    def result(self, found: _Found) -> Plan:
        """The plan of what the search settled on."""
        times = found.trajectory.knots[1:-1].tolist()
        return Plan(
            problem=self.problem,
            trajectory=found.trajectory,
            planner="min-snap",
            order=self.config.order,
            cost=found.cost,
            status="feasible" if found.feasible else "stopped",
            backend="closed form",
            stages=tuple(
                PlacedStage(stage.name, i, time, stage.gate)
                for i, (stage, time) in enumerate(zip(self.sequence.stages, times, strict=True))
            ),
            attempts=tuple(self.attempts),
            vehicle=self.vehicle,
            margin=found.margin,
            certificate=found.certificate,
        )
