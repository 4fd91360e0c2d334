"""Multi-start: paths are refined roughly from many starts, the fastest with more segments, the best is kept.

Paths have many local optima. Where a start is does more for a plan's duration than how finely it is refined.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain, islice
from math import inf

import numpy as np

from aerobat.errors import Infeasible, Reason, limits_of
from aerobat.optimization.deadline import out_of_time, processor, within_share, within_time
from aerobat.planning.around.fastest import fastest_around
from aerobat.planning.around.guesses import ROUTES, guesses
from aerobat.planning.assessment.assessment import SUSPICIOUS
from aerobat.planning.assessment.lower_bound import least_duration
from aerobat.planning.courses import is_course
from aerobat.planning.miqp.miqp import Miqp
from aerobat.planning.miqp.rescue import with_more_intervals
from aerobat.planning.polynomial.starts import SLOWER_PACES, closed_forms, starts
from aerobat.planning.refinement.flown import FlownPath
from aerobat.planning.refinement.refine import MAX_SEGMENTS, SEGMENTS, RefinedPath, Refinement, segments_for
from aerobat.planning.result import Plan
from aerobat.planning.task import Task
from aerobat.planning.time_limit import best_in_time
from aerobat.planning.turns import extra_turns, priced_duration
from aerobat.planning.warm_start import WarmStart

WORTHWHILE = 0.01  # of the duration: four times as many where twice as many gain more
SAME = 1e-3  # of the duration: starts that come to nearly the same have come to the same path
SLOWER = 1.5  # times the duration of a plan that knows no rotors
PACE_SPREAD = 0.4  # standard deviation of the logarithm of a phase's pace, where paces are drawn
SEED = 0
ASIDE = 0.1  # of a path's extent, by which it is bent out of its plane: symmetry is an optimum of its own
FINISHED = 3  # certified paths, the best of which is kept, where the first touches frames or loses much
# [s] of the processor, for a program of more intervals, of which one of nine stages takes four, or for what
# is tried beside routes around obstacles
MORE_TIME = 10.0
RAISED = (0.25, 0.5, 0.75, 1.0)  # of the reserve, step by step
RAISING_TIME = 40.0  # [s] of the processor, for all of these: of two flips in a row they take half
ROUGH_TIME = 0.5  # of the time that is left, where there is a limit, for rough rounds

_Start = tuple[Plan | None, WarmStart]  # a path, and the plan that it is of, if it is one's


def quick_guess() -> Miqp:
    """The mixed-integer planner whose plan is a start: of few segments, not flown."""
    return Miqp(segments=4, flies=False, rescue=False)


@dataclass(frozen=True, eq=False)
class MultiStart:
    """The search for the fastest certified path from a number of starts, for a planner."""

    planner: str
    refinement: Refinement
    starts: int  # that are tried together; on a course one after another, up to one clear of frames
    segments: int  # of a path, at most, but one a phase between stages at least
    leg_segments: int  # of a course's leg, at most
    start: Plan | None  # whose path is tried alone, before these
    guess: Miqp  # whose plan is one of the starts
    finalists: int  # of the fastest rough paths, that are given twice as many segments; one then four times

    def plan(self, time_limit: float | None) -> Plan:
        """The fastest certified plan found; where none is faster, one that it began from.

        Args:
            time_limit: For planning [s]; None for as long as it takes.

        Raises:
            Infeasible: Nothing is certified.
        """
        task, recorder = self._task, self.refinement.recorder
        found = best_in_time(task.problem, time_limit, recorder, self._fastest)
        if found is not None:
            return found
        last = recorder.last_outcome
        is_closed = len(task.environment.pieces) and next(guesses(task), None) is None
        where = "between obstacles no way was found, and " if is_closed else ""
        sentence = (
            f"no path of '{task.problem.name}' is certified for {task.vehicle.name}: {where}at the last "
            f"attempt {last}, which does not prove that there is none; widen what binds there, or give other "
            f"--segments{', or take --planner time-optimal' * (self.planner == 'free-knots')}"
        )
        raise Infeasible(Reason(sentence, limits_of(last)), recorder.attempts)

    @property
    def _task(self) -> Task:
        return self.refinement.task

    @property
    def _least_segments(self) -> int:
        """The number of segments of rough paths."""
        return segments_for(self._task.stages, min(self.segments, SEGMENTS))

    @property
    def _most_segments(self) -> int:
        """The number of segments that the fastest paths may have."""
        stages, most = self._task.stages, self.segments
        if is_course(stages):
            most = max(most, self.leg_segments * (len(stages.stages) + 1))
        return min(max(most, self._least_segments), MAX_SEGMENTS)

    def _fastest(self) -> Plan | None:
        """The fastest plan of all starts, or one that a start was, if that is faster."""
        best, known = self._around(), list[Plan]()
        for refinement, begun in self._batches() if best is None else ():
            known += [plan for plan, _ in begun if plan is not None]
            found = self._with_or_without_rooms(refinement, [path for _, path in begun])
            best = min(filter(None, (best, found)), key=_Found.rank, default=None)
            if out_of_time() or (best is not None and best.path.is_clear):
                break
        if best is not None and self._lacks_places and not out_of_time():
            best = self._faster(best)
        return self._or_begun_from(None if best is None else self._plan(best), known)

    @property
    def _lacks_places(self) -> bool:
        """True of a course of attitudes alone, which say nothing to the closed forms that it begins at."""
        stages = self._task.stages
        return is_course(stages) and not any(stage.is_placed for stage in stages.stages)

    def _faster(self, best: _Found) -> _Found:
        """A path, or where it is slow the first faster one of programs without a reserve."""
        task, guess = self._task, replace(self.guess, reserve=0.0)
        if best.path.duration < SUSPICIOUS * least_duration(task.problem, task.vehicle):
            return best
        more = with_more_intervals(guess, task.problem, task.vehicle)
        with within_time(RAISING_TIME, processor):
            for planner in chain([guess], (planner for planner, _ in more)):
                with suppress(Infeasible):
                    begun = WarmStart.of(planner.plan(task.problem, task.vehicle), task.stages)
                    found = self._finished(self.refinement, self._at_reserve(begun), best)
                    if found is not None and found is not best:
                        return found
                if out_of_time():
                    break
        return best

    def _at_reserve(self, begun: WarmStart) -> list[RefinedPath]:
        """The rough path near one without a reserve, which is raised in steps; none if one loses its way."""
        for share in RAISED:
            task = replace(self._task, reserve=share * self._task.reserve)
            refinement = replace(self.refinement, task=task)
            rough = refinement.rough(begun, self._least_segments)
            begun = rough.path
        return [rough] if refinement.is_promising(rough) else []

    def _or_begun_from(self, found: Plan | None, begun: Sequence[Plan]) -> Plan | None:
        """What was found, or a better one of the plans that it began from, certified and with the reserve."""
        task = self._task
        plans = (plan if plan.vehicle == task.vehicle else plan.for_vehicle(task.vehicle) for plan in begun)
        kept = [plan for plan in plans if plan.certified and plan.keeps(task.reserve)]
        known = min(kept, key=self._priced, default=None)
        if known is None or (
            found is not None and found.certified and self._priced(found) <= self._priced(known)
        ):
            return found
        said = f"{self.planner} found none better than the path that it began from, {known.planner}'s"
        attempts = tuple(self.refinement.recorder.attempts)
        return replace(known, planner=self.planner, attempts=attempts, rescue=said)

    def _around(self) -> _Found | None:
        """The fastest path around obstacles; None where there are none, or no route leads to one."""
        if self.start is not None or not len(self._task.environment.pieces):
            return None
        around = fastest_around(self.refinement, self._least_segments)
        if around is None:
            return None
        refinement, found = around.refinement, _Found(around.through_gates())
        best = self._finished(refinement, [around.judged.solution.source], found)
        # routes are starts too, but know no attitudes: where those are asked, others may be nearer
        count = self.starts if self._task.stages.asks_thrust else max(self.starts - ROUTES, 0)
        if best is None or is_course(self._task.stages) or not count:
            return best
        with suppress(Infeasible), within_time(MORE_TIME, processor):
            _, begun = next(self._batches())
            rough = self._rough(refinement, [path for _, path in begun[:count]])
            best = self._finished(refinement, rough, best)
        return best

    def _batches(self) -> Iterator[tuple[Refinement, list[_Start]]]:
        """Yield starts that are tried together, the next where these lead to no path clear of frames.

        Each comes with the refinement that it is given: a course's closed forms are tried in haste first.
        """
        task = self._task
        if self.start is not None:
            yield self.refinement, [(self.start, WarmStart.of(self.start, task.stages))]
        guess = replace(self.guess, reserve=task.reserve)
        if is_course(task.stages):
            hasty = replace(self.refinement, hasty=True)
            for start in closed_forms(task, (1.0, *SLOWER_PACES)):
                yield hasty, [start]
            for each in chain(starts(task, guess), closed_forms(task, SLOWER_PACES), self._of_more(guess)):
                yield self.refinement, [each]
            return
        with within_share(ROUGH_TIME):
            others = list(starts(task, guess))
            if not any(plan and not extra_turns(task, path.trajectory) for plan, path in others):
                finer = starts(task, replace(guess, segments=SEGMENTS))
                others += [each for each in finer if each[0] is not None]
        yield self.refinement, list(islice(_varied(sorted(others, key=_likeliest)), self.starts))

    def _priced(self, path: Plan | WarmStart) -> float:
        return priced_duration(self._task, path.trajectory)

    def _of_more(self, guess: Miqp) -> Iterator[_Start]:
        """Yield the plans of mixed-integer programs of more intervals, of an open course."""
        task = self._task
        ways = () if task.stages.closed else with_more_intervals(guess, task.problem, task.vehicle)
        for planner, _ in ways:
            try:
                with within_time(MORE_TIME, processor):
                    plan = planner.plan(task.problem, task.vehicle)
            except Infeasible:
                continue
            yield plan, WarmStart.of(plan, task.stages)

    def _with_or_without_rooms(self, whole: Refinement, paths: Sequence[WarmStart]) -> _Found | None:
        """The fastest path near some, without rooms in gates where there is none with them."""
        for refinement in whole.with_and_without_rooms:
            found = self._finished(refinement, self._rough(refinement, paths))
            if found is not None or out_of_time():
                return found
        return None

    def _finished(
        self, refinement: Refinement, rough: Sequence[RefinedPath], best: _Found | None = None
    ) -> _Found | None:
        """The best of the certified paths near rough ones, the fastest of them first, and of a known one."""
        starts, certified = tuple(map(_duration, rough)), [] if best is None else [best]
        with within_share(ROUGH_TIME):
            paths = self._with_more_segments(refinement, rough)
        for path in paths:
            if len(certified) >= FINISHED or (best is not None and (best.is_ahead_of(path) or out_of_time())):
                break
            judged = refinement.finished(path)
            if judged.feasible:
                certified.append(_Found(FlownPath.of(refinement, judged).through_gates(), starts))
                best = min(certified, key=_Found.rank)
        return best

    def _rough(self, refinement: Refinement, begun: Sequence[WarmStart]) -> list[RefinedPath]:
        """The rough paths near starts, without those that lose their way, the fastest first."""
        found: list[RefinedPath] = []
        for path in begun:
            known = min(map(_duration, found), default=inf)
            rough = refinement.rough(path, self._least_segments, known)
            if refinement.is_promising(rough):
                found.append(rough)
            if found and out_of_time():
                break
        return sorted(found, key=lambda rough: self._priced(rough.path))

    def _with_more_segments(
        self, refinement: Refinement, paths: Sequence[RefinedPath]
    ) -> Sequence[RefinedPath]:
        """Sorted paths, the fastest with twice as many segments, and fewer of them again while that gains."""
        for doubling, count in enumerate((self.finalists, 1), 1):
            segments = min(2**doubling * self._least_segments, self._most_segments)
            paths, known = _distinct(paths), inf
            found = list(paths)
            for path in paths[:count]:
                if path.path.trajectory.segments < segments and not out_of_time():
                    finer = refinement.finer(path, segments, known)
                    if refinement.is_promising(finer):
                        found.append(finer)
                        known = min(known, _duration(finer))
            found.sort(key=lambda finer: self._priced(finer.path))
            if not found or _duration(found[0]) > (1.0 - WORTHWHILE) * _duration(paths[0]):
                return found
            paths = found
        return paths

    def _plan(self, found: _Found) -> Plan:
        """The plan of what was found, with more reserve if its flight wants it."""
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
    """A certified path, and what all starts that were tried with it came to."""

    path: FlownPath
    starts: tuple[float, ...] = ()  # [s] roughly, rising

    def rank(self) -> tuple[bool, float]:
        """The key that sorts by what is best: clear of frames first, the shortest foremost, turns priced."""
        return not self.path.is_clear, self._priced(self.path.judged.solution.source)

    def is_ahead_of(self, rough: RefinedPath) -> bool:
        """True if a rough path is not worth finishing."""
        return self.path.is_clear and self.rank()[1] <= self._priced(rough)

    def _priced(self, refined: RefinedPath) -> float:
        return priced_duration(self.path.refinement.task, refined.path.trajectory)


def _likeliest(begun: _Start) -> tuple[bool, bool, float]:
    """The key that sorts starts: certified plans, other plans, paths of no plan; the shortest foremost."""
    plan, path = begun
    return plan is None, plan is None or not plan.certified, path.trajectory.duration


def _varied(begun: Sequence[_Start]) -> Iterator[_Start]:
    """Yield starts, those that know no rotors also slower, then all at paces that are drawn, without end.

    After each that nearly lies in a vertical plane comes the same bent out of it.
    """
    sources: list[_Start] = []
    for plan, path in begun:
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
    """Sorted paths without those that take nearly as long as the one before."""
    before = [0.0, *map(_duration, paths)]
    return [each for each, last in zip(paths, before, strict=False) if _duration(each) > (1.0 + SAME) * last]


def _duration(path: RefinedPath) -> float:
    return path.path.trajectory.duration
