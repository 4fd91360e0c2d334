"""plan_to_pass(): plan, fly, tighten, until flights pass with the probability asked."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from math import ceil, log
from typing import Annotated, Any

from pydantic import Field

from aerobat.control import named_controller
from aerobat.declaration import Seed, validated
from aerobat.environment import Dispersion, as_dispersion
from aerobat.errors import Infeasible, SpecError
from aerobat.evaluation import Score
from aerobat.evaluation.opening import Probability
from aerobat.planning import Attempt, Plan, Planner, as_planner, plan
from aerobat.planning.tube import Tube
from aerobat.problem import Problem, as_problem
from aerobat.studies.flights import FlightTask, cut, fly_scores
from aerobat.studies.passing.causes import standing_in_the_way
from aerobat.studies.passing.result import Passing, Round
from aerobat.studies.passing.spread import LEVEL, firmer, narrowed, spread_of
from aerobat.studies.share import CONFIDENCE, Share, percent
from aerobat.studies.workers import Pool, Workers, pool
from aerobat.vehicle import Vehicle, as_vehicle

STEP = 0.02  # of every limit's range, between reserves that are tried
STRIDE = 4  # steps from one round to the next until flights pass
# steps in the first round: flights that are lost ask for all the range, and less is enough to keep them
MAX_FIRST = 5
MAX_STEPS = 20  # a reserve of two fifths at either end leaves a fifth of the range to fly with
# fresh flights that are expected to fail at the probability asked: half as many failures are then a proof
PROVING_FAILURES = 20
# proofs are attempted on flights of their own: each errs with 2.5 % at most, both together with 5 %
PROOFS = 2
Flights = Annotated[int, Field(ge=1, le=10**6, description="whole number from 1 to a million")]


@validated
def plan_to_pass(
    problem: Problem | str,
    planner: Planner | str = "miqp",
    vehicle: Vehicle | str = "agile-quad",
    *,
    probability: Probability = 0.99,
    conditions: Dispersion | str = "lab",
    seed: Seed = 0,
    controller: str = "full",
    flights: Flights = 1000,
    fresh: Flights | None = None,
    workers: Workers | None = None,
    executor: Executor | None = None,
    progress: Callable[[Attempt], None] | None = None,
    tried: Callable[[Round], None] | None = None,
) -> Passing:
    """Plan a problem so that flights under conditions pass with a probability, proven on fresh flights.

    The plain plan is flown many times. Where too few flights pass, their spread says which reserve of the
    rotors' limits to begin with, by how much to narrow the gates for planning, and how much thrust to ask for
    in them; the smallest reserve of a ladder is sought with which enough of the same flights pass. The plan
    found is then flown on flights that nothing was learned from: it is returned if the lower end of Clopper
    and Pearson's interval reaches the probability. A flight passes where nothing goes wrong, as its `Outcome`
    says.

    Args:
        problem: What is planned, or its name.
        planner: How, one with a `reserve`, or its registered name.
        vehicle: What flies it, or its name.
        probability: With which a flight shall pass [-].
        conditions: What varies from flight to flight, or the name of a preset or a file.
        seed: Of the flights.
        controller: The name of what flies: full, or a control law.
        flights: How many tell how to tighten, numbered from 0.
        fresh: How many prove it, numbered behind those; by default 20 over the probability of failing.
        workers: Processes, by default one a core; 1 flies in this process; dask://HOST:PORT on a cluster.
        executor: Any of `concurrent.futures` that flies instead, as a `dask.distributed` client's.
        progress: Called with every attempt at a plan as it ends.
        tried: Called with every round as it ends.

    Raises:
        Infeasible: there is no plan, or none that passes so often; the message names the cause in the way.
        SpecError: the planner keeps no reserve, or so few flights cannot prove such a probability.
    """
    method, conditions = as_planner(planner), as_dispersion(conditions)
    if not hasattr(method, "reserve"):
        raise SpecError(
            "planner keeps no reserve, by which plans are tightened; take miqp, free-knots or time-optimal"
        )
    proving = fresh or max(round(PROVING_FAILURES / (1.0 - probability)), _least_flights(probability))
    _require_enough("flights", flights, probability)
    _require_enough("fresh", proving, probability)
    named_controller(controller)
    flown = range(flights)
    with pool(workers, executor, len(cut(range(max(flights, proving))))) as flying:
        task = _PassingTask(
            as_problem(problem),
            method,
            as_vehicle(vehicle),
            conditions,
            seed,
            controller,
            probability,
            progress,
            flying,
        )
        return _Tightening(task, flown, proving, tried or (lambda done: None)).passing()


def _least_flights(probability: float) -> int:
    """The number of flights that prove a probability if all of them pass."""
    return ceil(log(0.5 * (1.0 - CONFIDENCE)) / log(probability))


def _require_enough(name: str, flights: int, probability: float) -> None:
    """Refuse a number of flights that proves nothing even where all of them pass."""
    least = _least_flights(probability)
    if flights < least:
        raise SpecError(
            f"{name}: {flights} flights cannot prove {100 * probability:g} %; take {least} or more, or a "
            "smaller probability"
        )


@dataclass(frozen=True, eq=False)
class _PassingTask:
    """What is planned, flown and asked."""

    problem: Problem
    planner: Any  # a planner with a reserve
    vehicle: Vehicle
    conditions: Dispersion
    seed: int
    controller: str
    probability: float
    progress: Callable[[Attempt], None] | None
    flying: Pool

    def plan(self, reserve: float, problem: Problem) -> Plan:
        """The plan with a reserve, and through gates as `problem` has them, judged by the task's own."""
        found = plan(problem, replace(self.planner, reserve=reserve), self.vehicle, self.progress)
        return replace(found, problem=self.problem)

    def scores(self, found: Plan, flights: range, conditions: Dispersion | None = None) -> Score:
        """Scores of flights of a plan, by default under the task's conditions."""
        controller = named_controller(self.controller, self.vehicle.controller)
        task = FlightTask(found, self.vehicle, conditions or self.conditions, self.seed, controller)
        return fly_scores(self.flying, (task,), flights)[0]

    def share(self, found: Plan, flights: range, conditions: Dispersion | None = None) -> Share:
        """The share of flights of a plan that pass."""
        return _passed(self.scores(found, flights, conditions))

    def is_enough(self, share: Share) -> bool:
        """True where so many flights prove the probability."""
        return share.interval[0] >= self.probability


@dataclass
class _Tightening:
    """The search for the smallest reserve that is enough."""

    task: _PassingTask
    training: range
    proving: int
    tried: Callable[[Round], None]
    rounds: list[Round] = field(default_factory=list)

    def passing(self) -> Passing:
        """The plan that passes, proven. Raises Infeasible where there is none."""
        plain, scores = self._plain()
        self._narrowed = self.task.problem
        steps, done = 0, plain
        if not self.task.is_enough(plain.share):
            self._narrowed = narrowed(self.task.problem, self.task.vehicle, scores)
            steps, done = self._smallest(self._first_steps(plain.plan))
        for attempt in range(PROOFS):
            fresh = self._fresh(attempt)
            share = self.task.share(done.plan, fresh)
            if self.task.is_enough(share):
                return self._proven(done, share, fresh)
            following = self._round(steps + STRIDE) if attempt + 1 < PROOFS else None
            if following is None:
                raise self._unreachable(done, fresh)
            steps, done = steps + STRIDE, following
        raise AssertionError("a proof ends one way or the other")

    def _plain(self) -> tuple[Round, Score]:
        found = self.task.plan(self.task.planner.reserve, self.task.problem)
        scores = self.task.scores(found, self.training)
        return self._noted(Round(self.task.planner.reserve, found, _passed(scores))), scores

    def _first_steps(self, plain: Plan) -> int:
        """The steps of reserve that the spread of the plain plan's commands asks for."""
        task = self.task
        spread = spread_of(plain, task.vehicle, task.conditions, task.seed, task.controller, self.training)
        return min(max(ceil(spread.reserve / STEP), 1), MAX_FIRST)

    def _smallest(self, first: int) -> tuple[int, Round]:
        """The fewest steps of reserve with which enough training flights pass, or nearly, and that round.

        Args:
            first: Steps to begin with.
        """
        low, high, steps = 0, MAX_STEPS + 1, first  # high: without a plan
        while steps > low:
            done = self._round(steps)
            if done is None:
                high = steps
            elif self.task.is_enough(done.share):
                return self._refined(low, steps, done)
            else:
                low = steps
            steps = min(low + STRIDE, (low + high) // 2)
        best = max(self.rounds, key=lambda each: each.share.count)
        if best.share.fraction < self.task.probability:
            raise self._unreachable(best, self.training)
        return round((best.reserve - self.task.planner.reserve) / STEP), best

    def _refined(self, low: int, high: int, best: Round) -> tuple[int, Round]:
        """The fewest steps between too few and enough, by bisection."""
        while high - low > 1:
            middle = (low + high) // 2
            done = self._round(middle)
            if done is not None and self.task.is_enough(done.share):
                high, best = middle, done
            else:
                low = middle
        return high, best

    def _round(self, steps: int) -> Round | None:
        """A round with so many steps of reserve; None where there is no such plan.

        Where too many flights stray off their attitude in a gate, one more with more thrust there, which
        stays for the rounds that follow if it is better.
        """
        found = self._planned(steps, self._narrowed)
        if found is None:
            return None
        done, scores = found
        if self.task.is_enough(done.share):
            return done
        kept = 0.5 * (1.0 + self.task.probability)  # half of those that may fail
        firm = firmer(self._narrowed, self.task.vehicle, done.plan, scores, kept)
        again = None if firm == self._narrowed else self._planned(steps, firm)
        if again is None or again[0].share.count <= done.share.count:
            return done
        self._narrowed = firm
        return again[0]

    def _planned(self, steps: int, problem: Problem) -> tuple[Round, Score] | None:
        """A round with so many steps of reserve through gates as a problem has them, and its scores."""
        reserve = round(self.task.planner.reserve + steps * STEP, 9)
        try:
            found = self.task.plan(reserve, problem)
        except (Infeasible, SpecError):  # no plan, or no such reserve
            return None
        scores = self.task.scores(found, self.training)
        return self._noted(Round(reserve, found, _passed(scores))), scores

    def _noted(self, done: Round) -> Round:
        self.rounds.append(done)
        self.tried(done)
        return done

    def _fresh(self, attempt: int) -> range:
        """Numbers of flights that nothing was learned from."""
        first = len(self.training) + attempt * self.proving
        return range(first, first + self.proving)

    def _proven(self, done: Round, share: Share, fresh: range) -> Passing:
        task, plain = self.task, self.rounds[0]
        spread = spread_of(done.plan, task.vehicle, task.conditions, task.seed, task.controller, fresh)
        tube = Tube(
            conditions=task.conditions.name,
            seed=task.seed,
            level=LEVEL,
            times=tuple(spread.times.tolist()),
            position_error=tuple(spread.position_error.tolist()),
            attitude_error=tuple(spread.attitude_error.tolist()),
            rotor_margin=tuple(spread.rotor_margin.tolist()),
            reserve=done.reserve,
            plain_duration=plain.plan.duration,
            probability=task.probability,
            passed=share.count,
            flights=share.of,
            lower_bound=share.interval[0],
        )
        return Passing(
            plan=replace(done.plan, tube=tube),
            plain=plain.plan,
            before=share if done is plain else task.share(plain.plan, fresh),
            after=share,
            probability=task.probability,
            fresh=fresh,
            rounds=tuple(self.rounds),
        )

    def _unreachable(self, best: Round, flights: range) -> Infeasible:
        """The error that says how often flights pass at most, and which cause stands in the way."""
        task, share = self.task, self.task.share(best.plan, flights)
        cause = standing_in_the_way(task.conditions, lambda without: task.share(best.plan, flights, without))
        why = "" if cause is None else f"; {cause.sentence(task.probability)}"
        return Infeasible(
            f"'{task.problem.name}' on {task.vehicle.name} is not proven to pass as often as asked, "
            f"{percent(task.probability)} %: under {task.conditions.name} {share} pass at best, with a "
            f"reserve of {best.reserve:g}{why}; ask for less, or better that",
            [attempt for done in self.rounds for attempt in done.plan.attempts],
            remedy="",
        )


def _passed(scores: Score) -> Share:
    return Share(int(scores.succeeded.sum()), len(scores))
