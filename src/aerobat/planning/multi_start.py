"""Multi-start: many starts are refined roughly, the fastest with more segments, and the best is kept.

Refinement has many local optima. The choice of the start affects a plan's duration more than the number of
segments does.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import chain, islice
from math import inf

import numpy as np

from aerobat.errors import Infeasible, Reason, limits_of
from aerobat.optimization.deadline import out_of_time, within_share, within_time, work
from aerobat.planning.around.fastest import fastest_around
from aerobat.planning.around.guesses import ROUTES, guesses
from aerobat.planning.assessment.assessment import SUSPICIOUS
from aerobat.planning.assessment.lower_bound import least_duration
from aerobat.planning.courses import is_course
from aerobat.planning.miqp.miqp import Miqp
from aerobat.planning.polynomial.closed_forms import SLOWER_PACES, closed_forms
from aerobat.planning.polynomial.starts import starts
from aerobat.planning.refinement.flown import FlownPath
from aerobat.planning.refinement.refine import (
    MAX_SEGMENTS,
    SEGMENTS,
    RefinedPath,
    Refinement,
    segments_for,
)
from aerobat.planning.result import Plan
from aerobat.planning.task import Task
from aerobat.planning.time_limit import best_in_time
from aerobat.planning.turns import extra_turns, priced_duration
from aerobat.planning.warm_start import WarmStart

WORTHWHILE = 0.01  # relative gain of duration by twice as many segments above which four times are tried
WORTHWHILE_ACCURATE = 5e-4  # the same with high accuracy
# Number of fastest rough paths that get twice as many segments; one then gets four times. With one of them,
# plans of 200 random problems take 1.38 of the best at most, with three 1.02, in a fourth more time.
FINALISTS = 3
SAME = 1e-3  # relative difference of durations below which two paths count as the same local optimum
SLOWER = 1.5  # factor on the duration of plans without a vehicle, which are tried slower, too
PACE_SPREAD = 0.4  # standard deviation of the logarithm of a random pace of a phase
SEED = 0
ASIDE = 0.1  # bend of planar paths out of their plane, relative to their extent: planar ones are local optima
# certified paths of which the best is kept if it is clear of frames; later ones only while rough paths are
# faster
FINISHED = 3
# work limit [s] of one program with more intervals (with nine stages, such a program takes 4 s), or of
# the other starts beside routes around obstacles
MORE_WORK = 10.0
RESERVE_FRACTIONS = (0.25, 0.5, 0.75, 1.0)  # fractions of the reserve, raised step by step
RAISING_WORK = 40.0  # work limit [s] of raising it; two flips in a row take half of that
ROUGH_TIME = 0.5  # fraction of the remaining time for rough rounds, where there is a time limit

_Start = tuple[Plan | None, WarmStart]  # a path, with its plan if it comes from one


def quick_guess() -> Miqp:
    """Return the mixed-integer planner for starts: few segments, no simulated flight, no fallbacks."""
    return Miqp(segments=4, flies=False, rescue=False)


@dataclass(frozen=True, eq=False)
class MultiStart:
    """The search for the fastest certified path from several starts, on behalf of a planner."""

    planner: str
    refinement: Refinement
    segments: int  # largest number of a path's segments, but at least one a phase between stages
    start: Plan | None  # a plan whose path is tried alone, before the other starts
    # Number of starts tried together; on a course one at a time, until one is clear of frames. Eight, with
    # twice as many segments, gain 0.3 % at the median of 300 random problems, in twice the time.
    starts: int = 3
    # Largest number of segments of a course's leg. With four, plans of random courses are 1.2 % shorter than
    # with two at the median, and take a fifth more time.
    leg_segments: int = 4
    guess: Miqp = field(default_factory=quick_guess)  # the planner whose plan is one of the starts
    _given_up: dict[WarmStart, None] = field(default_factory=dict, init=False, repr=False)  # starts, in order

    def plan(self, time_limit: float | None) -> Plan:
        """Return the fastest certified plan found, which may be a plan from which the search started.

        Args:
            time_limit: Limit of the planning time [s]; None for no limit.

        Raises:
            Infeasible: No path is certified.
        """
        task, recorder = self._task, self.refinement.recorder
        found = best_in_time(task.problem, time_limit, recorder, self._fastest)
        if found is not None:
            return found
        made = recorder.attempts
        last = made[-1].outcome if made else "no path to begin from was found"
        is_closed = len(task.environment.pieces) and next(guesses(task), None) is None
        where = "between obstacles no way was found, and " if is_closed else ""
        sentence = (
            f"no path of '{task.problem.name}' is certified for {task.vehicle.name}: {where}at the last "
            f"attempt {last}, which does not prove that there is none; widen what binds there, or give other "
            f"--segments{', or take --planner time-optimal' * (self.planner == 'free-knots')}"
        )
        raise Infeasible(Reason(sentence, limits_of(last)), made)

    @property
    def _task(self) -> Task:
        return self.refinement.task

    @property
    def _least_segments(self) -> int:
        """The number of segments of rough paths."""
        return segments_for(self._task.stages, min(self.segments, SEGMENTS))

    @property
    def _most_segments(self) -> int:
        """The largest number of segments, for the fastest paths."""
        stages, most = self._task.stages, self.segments
        if is_course(stages):
            most = max(most, self.leg_segments * (len(stages.stages) + 1))
        return min(max(most, self._least_segments), MAX_SEGMENTS)

    def _fastest(self) -> Plan | None:
        """Return the fastest plan from all starts, which may be the plan of a start."""
        best, known = self._around(), list[Plan]()
        for refinement, batch in self._batches() if best is None else ():
            known += [plan for plan, _ in batch if plan is not None]
            found = self._with_or_without_rooms(refinement, [path for _, path in batch])
            best = min(filter(None, (best, found)), key=_Found.rank, default=None)
            if out_of_time() or (best is not None and best.path.is_clear):
                break
        if best is not None and self._lacks_places and not out_of_time():
            best = self._faster(best)
        return self._or_known(None if best is None else self._plan(best), known)

    @property
    def _lacks_places(self) -> bool:
        """True of a course of attitudes without positions, for which closed forms are poor starts."""
        stages = self._task.stages
        return is_course(stages) and not any(stage.is_placed for stage in stages.stages)

    def _faster(self, best: _Found) -> _Found:
        """Return the best path, or where it is slow the first faster one from programs without a reserve."""
        task, guess = self._task, replace(self.guess, reserve=0.0)
        if best.path.duration < SUSPICIOUS * least_duration(task.problem, task.vehicle):
            return best
        more = guess.with_more_intervals(task.problem, task.vehicle)
        with within_time(RAISING_WORK, work):
            for planner in chain([guess], more):
                with suppress(Infeasible):
                    start = WarmStart.of(planner.plan(task.problem, task.vehicle), task.stages)
                    found = self._finished(self.refinement, self._at_reserve(start), best)
                    if found is not None and found is not best:
                        return found
                if out_of_time():
                    break
        return best

    def _at_reserve(self, start: WarmStart) -> list[RefinedPath]:
        """Return the rough path from a start without reserve, after steps with rising reserve (continuation).

        Return no path if its constraint violations are too large after the last step.
        """
        for fraction in RESERVE_FRACTIONS:
            task = replace(self._task, reserve=fraction * self._task.reserve)
            refinement = replace(self.refinement, task=task)
            rough = refinement.rough(start, self._least_segments)
            start = rough.path
        return [rough] if refinement.is_promising(rough) else []

    def _or_known(self, found: Plan | None, known: Sequence[Plan]) -> Plan | None:
        """Return the plan found, or a better certified plan among the starts that keeps the reserve."""
        task = self._task
        plans = (plan if plan.vehicle == task.vehicle else plan.for_vehicle(task.vehicle) for plan in known)
        kept = [plan for plan in plans if plan.certified and plan.keeps(task.reserve)]
        best = min(kept, key=self._priced, default=None)
        if best is None or (
            found is not None and found.certified and self._priced(found) <= self._priced(best)
        ):
            return found
        said = f"{self.planner} found none better than the path that it began from, {best.planner}'s"
        attempts = tuple(self.refinement.recorder.attempts)
        return replace(best, planner=self.planner, attempts=attempts, rescue=said)

    def _around(self) -> _Found | None:
        """Return the fastest path around obstacles; None without obstacles, or if no route leads to one."""
        if self.start is not None or not len(self._task.environment.pieces):
            return None
        around = fastest_around(self.refinement, self._least_segments)
        if around is None:
            return None
        refinement, found = around.refinement, _Found(around.through_gates())
        best = self._finished(refinement, [around.judged.solution.source], found)
        # routes count as starts but ignore attitudes: where stages ask attitudes, all other starts are tried
        count = self.starts if self._task.stages.asks_thrust else max(self.starts - ROUTES, 0)
        if best is None or is_course(self._task.stages) or not count:
            return best
        with suppress(Infeasible), within_time(MORE_WORK, work):
            _, batch = next(self._batches())
            rough = self._rough(refinement, [path for _, path in batch[:count]])
            best = self._finished(refinement, rough, best)
        return best

    def _batches(self) -> Iterator[tuple[Refinement, list[_Start]]]:
        """Yield batches of starts, each with its refinement; later batches are tried if earlier ones fail.

        A batch fails if it leads to no certified path that is clear of gates' frames. The closed forms of a
        course are tried with a refinement that gives up early first, and those given up once more without.
        """
        task = self._task
        if self.start is not None:
            yield self.refinement, [(self.start, WarmStart.of(self.start, task.stages))]
        guess = replace(self.guess, reserve=task.reserve)
        if is_course(task.stages):
            quick = replace(self.refinement, gives_up_early=True)
            for start in closed_forms(task, (1.0, *SLOWER_PACES)):
                yield quick, [start]
            again = ((None, path) for path in self._given_up)
            for each in chain(again, starts(task, guess), self._of_more(guess)):
                yield self.refinement, [each]
            return
        with within_share(ROUGH_TIME):
            others = list(starts(task, guess))
            if not any(
                plan and not extra_turns(path.trajectory, task.stages, task.balance) for plan, path in others
            ):
                finer = starts(task, replace(guess, segments=SEGMENTS))
                others += [each for each in finer if each[0] is not None]
        yield self.refinement, list(islice(_varied(sorted(others, key=_likeliest)), self.starts))

    def _priced(self, path: Plan | WarmStart) -> float:
        return priced_duration(path.trajectory, self._task.stages, self._task.balance)

    def _of_more(self, guess: Miqp) -> Iterator[_Start]:
        """Yield starts from mixed-integer plans with more intervals; none for closed courses."""
        task = self._task
        for planner in () if task.stages.closed else guess.with_more_intervals(task.problem, task.vehicle):
            try:
                with within_time(MORE_WORK, work):
                    plan = planner.plan(task.problem, task.vehicle)
            except Infeasible:
                continue
            yield plan, WarmStart.of(plan, task.stages)

    def _with_or_without_rooms(self, whole: Refinement, paths: Sequence[WarmStart]) -> _Found | None:
        """Return the best path from some starts; room in gates is not required where no path has it."""
        for refinement in whole.with_and_without_rooms:
            found = self._finished(refinement, self._rough(refinement, paths))
            if found is not None or out_of_time():
                return found
        return None

    def _finished(
        self, refinement: Refinement, rough: Sequence[RefinedPath], best: _Found | None = None
    ) -> _Found | None:
        """Return the best of a known path and of the certified paths from rough ones, fastest rough first."""
        starts, certified = tuple(sorted(path.duration for path in rough)), [] if best is None else [best]
        with within_share(ROUGH_TIME):
            paths = self._with_more_segments(refinement, rough)
        for path in paths:
            has_most = len(certified) >= FINISHED and best is not None and best.path.is_clear
            if has_most or (best is not None and (best.is_ahead_of(path) or out_of_time())):
                break
            judged = refinement.finished(path)
            if judged.feasible:
                certified.append(_Found(FlownPath.of(refinement, judged).through_gates(), starts))
                best = min(certified, key=_Found.rank)
        return best

    def _rough(self, refinement: Refinement, batch: Sequence[WarmStart]) -> list[RefinedPath]:
        """Return the rough paths from starts, fastest first, without those that rounds cannot repair."""
        found: list[RefinedPath] = []
        for path in batch:
            known = min((each.duration for each in found), default=inf)
            rough = refinement.rough(path, self._least_segments, known)
            if refinement.gives_up_early and rough.path.trajectory.segments < self._least_segments:
                self._given_up[path] = None
            if refinement.is_promising(rough):
                found.append(rough)
            if found and out_of_time():
                break
        return sorted(found, key=lambda rough: self._priced(rough.path))

    def _with_more_segments(
        self, refinement: Refinement, paths: Sequence[RefinedPath]
    ) -> Sequence[RefinedPath]:
        """Return sorted paths, the fastest with twice as many segments, then one with four times as many.

        The second doubling is tried only if the first one is worthwhile.
        """
        for doubling, count in enumerate((FINALISTS, 1), 1):
            segments = min(2**doubling * self._least_segments, self._most_segments)
            paths, known = _distinct(paths), inf
            found = list(paths)
            for path in paths[:count]:
                if path.path.trajectory.segments < segments and not out_of_time():
                    finer = refinement.finer(path, segments, known)
                    if refinement.is_promising(finer):
                        found.append(finer)
                        known = min(known, finer.duration)
            found.sort(key=lambda finer: self._priced(finer.path))
            least = WORTHWHILE_ACCURATE if refinement.high_accuracy else WORTHWHILE
            if not found or found[0].duration > (1.0 - least) * paths[0].duration:
                return found
            paths = found
        return paths

    def _plan(self, found: _Found) -> Plan:
        """Return the plan of a path, with a larger reserve if its simulated flight needs that."""
        flown = found.path.with_reserves() if self._task.reserve > 0.0 else found.path
        return flown.judged.plan(
            self.refinement.recorder,
            planner=self.planner,
            order=5,
            status=flown.judged.solution.status,
            backend="builtin",
            stages=flown.judged.solution.source.placed,
            starts=found.starts,
        )


@dataclass(frozen=True)
class _Found:
    """A certified path, and the durations that all starts tried with it came to."""

    path: FlownPath
    starts: tuple[float, ...] = ()  # durations of the rough paths [s], ascending

    def rank(self) -> tuple[bool, float]:
        """Return the sort key, smallest is best: paths clear of frames first, then by priced duration."""
        return not self.path.is_clear, self._priced(self.path.judged.solution.source)

    def is_ahead_of(self, rough: RefinedPath) -> bool:
        """Return whether this path is clear of frames and not slower than a rough path."""
        return self.path.is_clear and self.rank()[1] <= self._priced(rough)

    def _priced(self, refined: RefinedPath) -> float:
        task = self.path.refinement.task
        return priced_duration(refined.path.trajectory, task.stages, task.balance)


def _likeliest(start: _Start) -> tuple[bool, bool, float]:
    """Return the sort key of starts: certified plans, other plans, other paths; each kind shortest first."""
    plan, path = start
    return plan is None, plan is None or not plan.certified, path.trajectory.duration


def _varied(batch: Sequence[_Start]) -> Iterator[_Start]:
    """Yield starts without end: the given ones, slower ones where rotors were ignored, then random paces.

    Each start that nearly lies in a vertical plane is followed by a copy that is bent out of the plane.
    """
    sources: list[_Start] = []
    for plan, path in batch:
        sources.append((plan, path))
        if plan is None or plan.vehicle is None:
            sources.append((None, path.time_scaled(SLOWER)))
    paced, rng = sources, np.random.default_rng(SEED)
    while sources:
        for plan, path in paced:
            yield plan, path
            plane = path.plane()
            if plane is not None:
                yield None, path.bent(ASIDE * path.extent * plane)
        paced = [
            (None, path.at_other_pace(np.exp(rng.normal(0.0, PACE_SPREAD, len(path.phases)))))
            for _, path in sources
        ]


def _distinct(paths: Sequence[RefinedPath]) -> list[RefinedPath]:
    """Return sorted paths without those that take nearly as long as the path before."""
    before = [0.0, *(path.duration for path in paths)]
    return [each for each, last in zip(paths, before, strict=False) if each.duration > (1.0 + SAME) * last]
