"""plan_to_pass(): plan, fly, tighten, until flights pass with the probability asked."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from math import ceil, inf, log, sqrt
from typing import Annotated, Any, cast

from pydantic import Field

from aerobat.control import named_controller
from aerobat.declaration import Seed, validated
from aerobat.environment import Dispersion, as_dispersion
from aerobat.errors import Infeasible, SpecError
from aerobat.evaluation import Score
from aerobat.evaluation.opening import Probability
from aerobat.optimization.deadline import processor, within_time
from aerobat.planning import Attempt, Plan, Planner, as_planner, plan
from aerobat.planning.planners import planner_with_reserve
from aerobat.planning.result import LITTLE_RESERVE
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
STRIDE = 3  # steps from one round to the next until flights pass
MAX_STEPS = 20  # a reserve of two fifths at either end leaves a fifth of the range to fly with
# fresh flights that are expected to fail at the probability asked: two thirds as many failures are a proof
PROVING_FAILURES = 50
# proofs are attempted on flights of their own: each errs with 2.5 % at most, both together with 5 %
PROOFS = 2
SCREENED = 200  # flights after which a plan that passes too seldom for its share to be doubtful is left
# fractions of the plain plan's largest body rate, to which tightened ones keep: rotors that lag otherwise
# than known are late, by the more degrees the faster a vehicle turns. Half the body rate made flips of five
# vehicles at most 2 % longer, with a fifth as many off their attitude; a third gained nothing (lab book)
CALMS = (1.0, 0.8, 0.65, 0.5)
KEPT_VARIANTS = 3  # that go on from a round in which too few flights pass
REFINING = "free-knots"  # the planner that goes on from a plan where the one asked for cannot
KEPT = ("segments", "clearance", "time_limit")  # of the settings of the one asked for
DEAR = 1.15  # times a round's shortest plan: longer ones lost their way, and a larger reserve costs less
# [s] of the processor for one tightened plan, or what the plain one took: those that are found take 0.3 to 3
TIGHTENING_TIME = 5.0
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

    The plain plan is flown many times. Where too few flights pass, their spread says by how much to narrow
    the gates for planning, and how much thrust to ask for in them; plans go on from the plain one with more
    reserve and less body rate, and the smallest reserve of a ladder is sought with which enough of the same
    flights pass. The plan found is then flown on flights that nothing was learned from: it is returned if the
    lower end of Clopper and Pearson's interval reaches the probability. A flight passes where nothing goes
    wrong, as its `Outcome` says.

    Args:
        problem: What is planned, or its name.
        planner: How, one with a `reserve`, or its registered name.
        vehicle: What flies it, or its name.
        probability: With which a flight shall pass [-].
        conditions: What varies from flight to flight, or the name of a preset or a file.
        seed: Of the flights.
        controller: The name of what flies: full, or a control law.
        flights: How many tell how to tighten, numbered from 0.
        fresh: How many prove it, numbered behind those; by default 50 over the probability of failing.
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


@dataclass(frozen=True)
class _Variant:
    """How a plan is tightened, beside its reserve."""

    calm: float  # [-] of the plain plan's largest body rate, that is left
    goes_on: bool  # from the plain plan; else the planner begins anew


VARIANTS = (*(_Variant(calm, True) for calm in CALMS), *(_Variant(calm, False) for calm in CALMS[::2]))


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

    def plain(self) -> Plan:
        """The plan as the planner finds it."""
        return plan(self.problem, self.planner, self.vehicle, self.progress)

    def tightened(
        self, plain: Plan, reserve: float, variant: _Variant, problem: Problem, limit: float
    ) -> Plan:
        """A variant of the plan with a reserve, judged by the task's own problem and vehicle.

        It is found within `limit` [s] of the processor.
        """
        vehicle, planner = self.vehicle, self._anew(reserve)
        if variant.calm < 1.0 and plain.assessment is not None:
            vehicle = replace(vehicle, max_body_rate=variant.calm * (plain.assessment.max_body_rate or inf))
        if variant.goes_on:
            planner = self._from(plain, reserve)
        with within_time(limit, processor):
            found = plan(problem, planner, vehicle, self.progress)
        return replace(found, problem=self.problem, vehicle=self.vehicle)

    def _from(self, start: Plan, reserve: float) -> Planner:
        """The planner with a reserve, or for one that takes no start, the refinement from a plan on."""
        if hasattr(self.planner, "start"):
            return cast(Planner, replace(self.planner, reserve=reserve, start=start))
        kept = {name: getattr(self.planner, name) for name in KEPT if hasattr(self.planner, name)}
        return planner_with_reserve(REFINING, reserve, start=start, **kept)

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
        """Scores of the flights that tell how to tighten, of the first ones where these tell that enough."""
        first = self.scores(found, flights[:SCREENED])
        if len(flights) <= SCREENED or _passed(first).interval[1] < self.probability:
            return first
        return self.scores(found, flights)

    def share(self, found: Plan, flights: range, conditions: Dispersion | None = None) -> Share:
        """The share of flights of a plan that pass."""
        return _passed(self.scores(found, flights, conditions))

    def is_enough(self, share: Share) -> bool:
        """True where so many flights prove the probability."""
        return share.interval[0] >= self.probability

    def is_likely_enough(self, share: Share) -> bool:
        """True where others would prove it too, even if one standard deviation fewer of them pass."""
        deviation = sqrt(share.of * share.fraction * (1.0 - share.fraction))
        return self.is_enough(Share(max(share.count - ceil(deviation), 0), share.of))


@dataclass(frozen=True, eq=False)
class _Flown:
    """A round, with what tells how to go on from it."""

    round: Round
    scores: Score
    variant: _Variant


@dataclass
class _Tightening:
    """The search for the smallest reserve that is enough."""

    task: _PassingTask
    training: range
    proving: int
    tried: Callable[[Round], None]
    rounds: list[Round] = field(default_factory=list)
    _variants: tuple[_Variant, ...] = VARIANTS

    def passing(self) -> Passing:
        """The plan that passes, proven. Raises Infeasible where there is none."""
        plain, scores = self._plain()
        self._narrowed = self.task.problem
        steps, done = 0, plain
        if not self.task.is_likely_enough(plain.share):
            self._narrowed = narrowed(self.task.problem, self.task.vehicle, scores)
            steps, done = self._smallest()
        for attempt in range(PROOFS):
            fresh = self._fresh(attempt)
            share = self.task.share(done.plan, fresh)
            if self.task.is_enough(share):
                return self._proven(done, share, fresh)
            self._variants = VARIANTS
            following = self._round(steps + STRIDE) if attempt + 1 < PROOFS else None
            if following is None:
                raise self._unreachable(done, fresh)
            steps, done = steps + STRIDE, following
        raise AssertionError("a proof ends one way or the other")

    def _plain(self) -> tuple[Round, Score]:
        began = processor()
        found = self.task.plain()
        took = 0.0 if found.rescue else processor() - began
        self._limit = max(took, TIGHTENING_TIME)
        asked = self.task.planner.reserve  # which a plan without one that keeps it gives up
        self._least = next((each for each in (asked, LITTLE_RESERVE) if found.keeps(each)), 0.0)
        scores = self.task.training(found, self.training)
        return self._noted(Round(self._least, found, _passed(scores))), scores

    def _smallest(self) -> tuple[int, Round]:
        """The fewest steps of reserve with which enough training flights pass, or nearly, and that round."""
        low, high, steps = -1, MAX_STEPS + 1, 0  # high: without a plan
        while steps > low:
            done = self._round(steps)
            if done is None:
                high = steps
            elif self.task.is_likely_enough(done.share):
                return self._refined(low, steps, done)
            else:
                low = steps
            steps = min(low + STRIDE, (low + high) // 2)
        best = max(self.rounds, key=_fraction)
        if best.share.fraction < self.task.probability:
            raise self._unreachable(best, self.training)
        return round((best.reserve - self._least) / STEP), best

    def _refined(self, low: int, high: int, best: Round) -> tuple[int, Round]:
        """The fewest steps between too few and enough, by bisection."""
        while high - low > 1:
            middle = (low + high) // 2
            done = self._round(middle)
            if done is not None and self.task.is_likely_enough(done.share):
                high, best = middle, done
            else:
                low = middle
        return high, best

    def _round(self, steps: int) -> Round | None:
        """The best round with so many steps of reserve; None where there is no such plan.

        Variants are tried until enough flights pass, from when on none but the last one is. Until then the
        best ones go on to the next round, and the best is tried again with more thrust in gates that flights
        pass off their attitude, which stays if that helps.
        """
        tried: list[_Flown] = []
        for variant in self._variants:
            longest = DEAR * min((each.round.plan.duration for each in tried), default=inf)
            found = self._planned(steps, variant, self._narrowed, longest)
            if found is not None:
                tried.append(found)
            if found is not None and self.task.is_likely_enough(found.round.share):
                self._variants = (variant,)
                return found.round
        if not tried:
            return None
        tried.sort(key=lambda each: _fraction(each.round), reverse=True)
        self._variants = tuple(each.variant for each in tried[:KEPT_VARIANTS])
        return self._firmer(steps, tried[0])

    def _firmer(self, steps: int, best: _Flown) -> Round:
        """A round with more thrust in gates, if more of its flights pass; else the one that is known."""
        kept = 0.5 * (1.0 + self.task.probability)  # half of those that may fail
        firm = firmer(self._narrowed, self.task.vehicle, best.round.plan, best.scores, kept)
        again = None if firm == self._narrowed else self._planned(steps, best.variant, firm)
        if again is None or _fraction(again.round) <= _fraction(best.round):
            return best.round
        self._narrowed = firm
        return again.round

    def _planned(
        self, steps: int, variant: _Variant, problem: Problem, longest: float = inf
    ) -> _Flown | None:
        """A round with so many steps of reserve; None without a plan, or one that is short enough."""
        reserve = round(self._least + steps * STEP, 9)
        try:
            found = self.task.tightened(self.rounds[0].plan, reserve, variant, problem, self._limit)
        except (Infeasible, SpecError):  # no plan, or no such reserve
            return None
        if found.duration > longest:
            return None
        scores = self.task.training(found, self.training)
        return _Flown(self._noted(Round(reserve, found, _passed(scores))), scores, variant)

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


def _fraction(done: Round) -> float:
    return done.share.fraction


def _passed(scores: Score) -> Share:
    return Share(int(scores.succeeded.sum()), len(scores))
