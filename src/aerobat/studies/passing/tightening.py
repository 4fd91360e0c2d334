"""The search for the smallest tightening (reserve) with which enough flights pass, and its validation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import inf

from aerobat.errors import Infeasible, SpecError
from aerobat.evaluation import Score
from aerobat.optimization.deadline import processor
from aerobat.planning import plan
from aerobat.planning.tube import Tube
from aerobat.problem import Problem
from aerobat.studies.flights import passed
from aerobat.studies.passing.causes import main_failure_cause
from aerobat.studies.passing.result import Passing, Round
from aerobat.studies.passing.spread import LEVEL, tube_series, with_more_thrust, with_narrower_gates
from aerobat.studies.passing.steadying import steadier
from aerobat.studies.passing.task import VARIANTS, PassingTask, Variant
from aerobat.studies.share import Share, percent

STEP = 0.02  # of every limit's range, step of the reserves that are tried
STRIDE = 3  # steps from one round to the next until enough flights pass
MAX_STEPS = 20  # a reserve of 0.4 at either end leaves a fifth of the range for flying
# proofs are attempted on separate flights: each errs with probability 2.5 % at most, both together 5 %
PROOFS = 2
KEPT_VARIANTS = 3  # variants that remain after a round in which too few flights pass
# times a round's shortest plan: longer ones are poor optima, and a larger reserve costs less
ROUND_DURATION_RATIO = 1.15
# [s] least processor time limit of a tightened plan (else the plain plan's time): plans found take 0.3 to 3
TIGHTENING_TIME = 5.0


@dataclass(frozen=True, eq=False)
class _Flown:
    """A round of the search, with the scores of its flights and its variant."""

    round: Round
    scores: Score
    variant: Variant


@dataclass
class Tightening:
    """The search for the smallest sufficient reserve."""

    task: PassingTask
    training: range
    proving: int
    tried: Callable[[Round], None]
    rounds: list[Round] = field(default_factory=list)
    _variants: tuple[Variant, ...] = VARIANTS

    def passing(self) -> Passing:
        """Return the plan that passes, with its proof. Raises Infeasible where there is none."""
        plain, scores = self._plain()
        passes, problem = self.task.is_likely_proof(plain.share), self.task.problem
        self._narrower = problem if passes else with_narrower_gates(problem, self.task.vehicle, scores)
        self._problem = self._narrower
        steps, done = (0, plain) if passes else self._steadied() or self._smallest()
        for attempt in range(PROOFS):
            fresh = self._fresh(attempt)
            share = self.task.share(done.plan, fresh)
            if self.task.is_proof(share):
                return self._proven(done, share, fresh)
            self._variants = VARIANTS
            following = self._round(steps + STRIDE) if attempt + 1 < PROOFS else None
            if following is None:
                raise self._unreachable(done, fresh)
            steps, done = steps + STRIDE, following
        raise AssertionError("a proof ends one way or the other")

    def _plain(self) -> tuple[Round, Score]:
        task, began = self.task, processor()
        found = plan(task.problem, task.planner, task.vehicle, task.progress)
        took = 0.0 if found.rescue else processor() - began
        self._limit = max(took, TIGHTENING_TIME)
        reserve = self.task.planner.reserve
        self._least = reserve if found.keeps(reserve) else 0.0  # a rescued plan gives the reserve up
        scores = self.task.training(found, self.training)
        return self._noted(Round(self._least, found, passed(scores))), scores

    def _steadied(self) -> tuple[int, Round] | None:
        """Return the steps of reserve and the round of the plan that commands take; None if too few pass."""
        plain = self.rounds[0].plan
        found, reserve = steadier(self.task, plain, self._least, may_grow=True)
        if found is plain:
            return None
        done = self._noted(Round(reserve, found, passed(self.task.training(found, self.training))))
        return (self._steps(done), done) if self.task.is_likely_proof(done.share) else None

    def _smallest(self) -> tuple[int, Round]:
        """Return the fewest steps of reserve with nearly enough passing training flights, and the round."""
        low, high, steps = -1, MAX_STEPS + 1, 0  # the fewest steps known without a plan
        while steps > low:
            done = self._round(steps)
            if done is None:
                high = steps
            elif self.task.is_likely_proof(done.share):
                return self._refined(low, steps, done)
            else:
                low = steps
            steps = min(low + STRIDE, (low + high) // 2)
        best = max(self.rounds, key=_fraction)
        if best.share.fraction < self.task.probability:
            raise self._unreachable(best, self.training)
        return self._steps(best), best

    def _steps(self, done: Round) -> int:
        """Return the steps of reserve of a round."""
        return round((done.reserve - self._least) / STEP)

    def _refined(self, low: int, high: int, best: Round) -> tuple[int, Round]:
        """Return the fewest sufficient steps between too few and enough, by bisection."""
        while high - low > 1:
            middle = (low + high) // 2
            done = self._round(middle)
            if done is not None and self.task.is_likely_proof(done.share):
                high, best = middle, done
            else:
                low = middle
        return high, best

    def _round(self, steps: int) -> Round | None:
        """Return the best round with this many steps of reserve; None where there is no such plan.

        Variants are tried until one has enough passing flights; later rounds try that variant alone.
        Otherwise the best variants remain for the next round, and the best plan is also planned with more
        thrust in gates that flights pass off their attitude. The added thrust stays if more flights pass with
        it. Where no remaining variant has a plan, all are tried again, without the added thrust.
        """
        tried = self._tried(steps, self._variants)
        if not tried:
            self._problem = self._narrower
            tried = self._tried(steps, VARIANTS)
        if not tried:
            return None
        if self.task.is_likely_proof(tried[-1].round.share):
            self._variants = (tried[-1].variant,)
            return tried[-1].round
        tried.sort(key=lambda each: _fraction(each.round), reverse=True)
        self._variants = tuple(each.variant for each in tried[:KEPT_VARIANTS])
        return self._with_more_thrust(steps, tried[0])

    def _tried(self, steps: int, variants: Sequence[Variant]) -> list[_Flown]:
        """Return the plans of variants that are not much longer than the others, up to a sufficient one."""
        tried: list[_Flown] = []
        for variant in variants:
            longest = ROUND_DURATION_RATIO * min((each.round.plan.duration for each in tried), default=inf)
            found = self._planned(steps, variant, self._problem, longest)
            if found is not None:
                tried.append(found)
                if self.task.is_likely_proof(found.round.share):
                    break
        return tried

    def _with_more_thrust(self, steps: int, best: _Flown) -> Round:
        """Return the round planned again with more thrust in gates if more flights pass, else the round."""
        kept = 0.5 * (1.0 + self.task.probability)  # half of the flights that may fail
        raised = with_more_thrust(self._problem, self.task.vehicle, best.round.plan, best.scores, kept)
        again = None if raised == self._problem else self._planned(steps, best.variant, raised)
        if again is None or _fraction(again.round) <= _fraction(best.round):
            return best.round
        self._problem = raised
        return again.round

    def _planned(self, steps: int, variant: Variant, problem: Problem, longest: float = inf) -> _Flown | None:
        """Return the round with this many steps of reserve; None without a plan, or with a longer one."""
        reserve = round(self._least + steps * STEP, 9)
        try:
            found = self.task.tightened(self.rounds[0].plan, reserve, variant, problem, self._limit)
        except (Infeasible, SpecError):  # no plan, or no such reserve
            return None
        if found.duration > longest:
            return None
        scores = self.task.training(found, self.training)
        return _Flown(self._noted(Round(reserve, found, passed(scores))), scores, variant)

    def _noted(self, done: Round) -> Round:
        self.rounds.append(done)
        self.tried(done)
        return done

    def _fresh(self, attempt: int) -> range:
        """Return numbers of flights that were not used in the search."""
        first = len(self.training) + attempt * self.proving
        return range(first, first + self.proving)

    def _proven(self, done: Round, share: Share, fresh: range) -> Passing:
        task, plain = self.task, self.rounds[0]
        tube = Tube(
            conditions=task.conditions.name,
            seed=task.seed,
            level=LEVEL,
            **tube_series(task, done.plan, fresh),
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
        """Return the error with the best share of passing flights and the main cause of failures."""
        task, share = self.task, self.task.share(best.plan, flights)
        why = main_failure_cause(
            task.conditions, task.probability, lambda without: task.share(best.plan, flights, without)
        )
        return Infeasible(
            f"'{task.problem.name}' on {task.vehicle.name} is not proven to pass as often as asked, "
            f"{percent(task.probability)} %: under {task.conditions.name} {share} pass at best, with a "
            f"reserve of {best.reserve:g}{f'; {why}' if why else ''}; ask for less, or better that",
            [attempt for done in self.rounds for attempt in done.plan.attempts],
            remedy="",
        )


def _fraction(done: Round) -> float:
    return done.share.fraction
