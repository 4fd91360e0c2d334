"""The fastest plan that is found: refined from many starts, the best of them with many knots.

Paths have many local optima. All starts are refined roughly, the fastest of them with more knots, and the
fastest that is certified is kept.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from functools import partial
from itertools import islice
from math import inf
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from aerobat.declaration import AS_IT_IS, NonNegative
from aerobat.errors import Infeasible, Reason, limits_of
from aerobat.optimization.deadline import out_of_time, within_share
from aerobat.planning.around.fastest import fastest_around
from aerobat.planning.certified_solve import Judged
from aerobat.planning.courses import is_course
from aerobat.planning.gate_clearance import is_clear
from aerobat.planning.miqp.miqp import Miqp
from aerobat.planning.planners import Planner, option, planner
from aerobat.planning.polynomial.starts import SLOWER_PACES, closed_forms, starts
from aerobat.planning.recorder import Progress, Recorder
from aerobat.planning.refinement.flown import FlownPath
from aerobat.planning.refinement.refine import MAX_SEGMENTS, SEGMENTS, RefinedPath, Refinement, segments_for
from aerobat.planning.result import FLYING_CLEARANCE, FLYING_RESERVE, Plan
from aerobat.planning.time_limit import TIME_LIMIT, best_in_time
from aerobat.planning.warm_start import CLEARANCE, Clearance, Reserve, WarmStart, flown_task
from aerobat.problem.problem import Problem
from aerobat.vehicle import Vehicle

STARTS = 8
FINALISTS = (3, 1)  # of the fastest paths, that are given twice as many segments, then four times as many
WORTHWHILE = 0.01  # of the duration: four times as many where twice as many gain more
LEG_SEGMENTS = 4  # of a course's leg
SAME = 1e-3  # of the duration: starts that come to nearly the same have come to the same path
SLOWER = 1.5  # times the duration of a plan that knows no rotors
PACE_SPREAD = 0.4  # standard deviation of the logarithm of a phase's pace, where paces are drawn
SEED = 0
ASIDE = 0.1  # of a path's extent, by which it is bent out of its plane: symmetry is an optimum of its own
ROUGH_TIME = 0.5  # of the time that is left, where there is a limit, for rough rounds


@planner("time-optimal")
class TimeOptimal(Planner):
    """The fastest certified path that is found from many starts; a yardstick for the other planners.

    Starts are the plans of other planners, with and without rotors, and the same at other paces; on a course
    the closed forms through its stages, around obstacles the fastest way past them. All of them are refined
    roughly; `Plan.starts` has their durations. The fastest get more polynomials as long as that gains, up to
    `segments`, a course four a leg, and the fastest that is certified is returned. A `start`, a plan of
    whichever planner, comes first. Each limit is used in full, which leaves nothing for a controller:
    `reserve`, a fraction of the range of rotors and body rate, is kept from either end for it.
    """

    PLANS_CLOSED_COURSES: ClassVar[bool] = True

    segments: Annotated[int, Field(ge=2, le=MAX_SEGMENTS)] = option(
        4 * SEGMENTS,
        "How many polynomial segments at most, one a phase between stages at least; a course has four a leg.",
    )
    reserve: Reserve = option(
        0.0,
        "The fraction of every limit of the vehicle that is kept from either of its ends for the controller; "
        "with 0 a time-optimal plan is a yardstick that no controller follows for sure.",
        command_default=FLYING_RESERVE,
    )
    clearance: Clearance = option(0.0, CLEARANCE, command_default=FLYING_CLEARANCE)  # [m]
    starts: Annotated[int, Field(ge=1)] = option(
        STARTS, "The number of starts; more find a faster local optimum at times, and take longer."
    )
    time_limit: NonNegative | None = option(None, TIME_LIMIT)  # [s]
    guess: Miqp = field(default_factory=partial(Miqp, segments=4, flies=False, rescue=False))
    start: Annotated[Plan, AS_IT_IS] | None = None

    def plan(
        self, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        """The fastest certified plan found; where none is faster, a plan that it began from.

        Raises SpecError without a vehicle and for input that makes no sense, Infeasible when nothing is
        certified.
        """
        task = flown_task("time-optimal", problem, vehicle, self.reserve, self.clearance)
        recorder = Recorder(progress)
        refinement = replace(Refinement.of(task, recorder), close=is_course(task.stages))
        found = best_in_time(problem, self.time_limit, recorder, lambda: self._fastest(refinement))
        if found is not None:
            return found
        last = recorder.last_outcome
        sentence = (
            f"no path of '{problem.name}' was found that {task.vehicle.name} can fly: at the last attempt "
            f"{last}; ask less of its stages and limits, or give more starts"
        )
        raise Infeasible(Reason(sentence, limits_of(last)), recorder.attempts)

    def _fastest(self, refinement: Refinement) -> Plan | None:
        """The fastest plan of all starts, or one that a start was, if that is faster."""
        task, start = refinement.task, self.start
        if start is None and len(task.environment.pieces):
            around = fastest_around(refinement, SEGMENTS)
            if around is not None:
                return self._raced(around.refinement, [around.judged.solution.source.path])
        begun: list[tuple[Plan | None, WarmStart]] = []
        if start is not None:
            begun.append((start, WarmStart.of(start, task.stages)))
        if is_course(task.stages):
            begun += closed_forms(task, (1.0, *SLOWER_PACES))
            own = self._on_course(refinement, [path for _, path in begun])
        else:
            with within_share(ROUGH_TIME):
                guess = replace(self.guess, reserve=self.reserve)
                others = list(starts(task, guess))
                if not any(plan for plan, _ in others):
                    others = list(starts(task, replace(guess, segments=SEGMENTS)))
                begun += sorted(others, key=_likeliest)
            own = self._with_or_without_rooms(refinement, list(islice(_varied(begun), self.starts)))
        plans = [plan for plan, _ in begun if plan is not None and plan.vehicle == task.vehicle]
        kept = [plan for plan in plans if plan.certified and plan.keeps(self.reserve)]
        known = min(kept, key=lambda plan: plan.duration, default=None)
        if known is None or (own is not None and own.duration <= known.duration):
            return own
        said = f"time-optimal found none faster than the path that it began from, {known.planner}'s"
        attempts = tuple(refinement.recorder.attempts)
        return replace(known, planner="time-optimal", attempts=attempts, rescue=said)

    def _on_course(self, refinement: Refinement, paths: Sequence[WarmStart]) -> Plan | None:
        """The plan near the first path that leads to one clear of frames: all lead to much the same."""
        best: Plan | None = None
        for path in paths[: self.starts]:
            found = self._with_or_without_rooms(refinement, [path])
            if found is not None and (best is None or _is_clear(found)):
                best = found
            if out_of_time() or (best is not None and _is_clear(best)):
                break
        return best

    def _with_or_without_rooms(self, refinement: Refinement, paths: Sequence[WarmStart]) -> Plan | None:
        """The fastest plan near some paths, without rooms in gates where there is none with them."""
        for each in refinement.with_and_without_rooms:
            found = self._raced(each, paths)
            if found is not None or out_of_time():
                return found
        return None

    def _raced(self, refinement: Refinement, starts: Sequence[WarmStart]) -> Plan | None:
        """The fastest certified plan near some starts; None where there is none."""
        rough = _rough(refinement, starts)
        with within_share(ROUGH_TIME):
            paths = self._with_more_segments(refinement, rough)
        best: Judged[RefinedPath] | None = None
        for path in paths:
            if best is not None and (_duration(path) >= best.solution.duration or out_of_time()):
                break
            judged = refinement.finished(path)
            if judged.feasible and (best is None or judged.solution.duration < best.solution.duration):
                best = judged
        if best is None:
            return None
        return self._plan(FlownPath.of(refinement, best), tuple(map(_duration, rough)))

    def _with_more_segments(
        self, refinement: Refinement, paths: Sequence[RefinedPath]
    ) -> Sequence[RefinedPath]:
        """Sorted paths, the fastest with twice as many segments, and fewer of them again while that gains."""
        stages = refinement.task.stages
        least = segments_for(stages)
        most = max(self.segments, LEG_SEGMENTS * (len(stages.stages) + 1) if is_course(stages) else least)
        for doubling, count in enumerate(FINALISTS, 1):
            segments = min(2**doubling * least, most, MAX_SEGMENTS)
            paths, known = _distinct(paths), inf
            found = list(paths)
            for path in paths[:count]:
                if path.path.trajectory.segments < segments and not out_of_time():
                    finer = refinement.finer(path, segments, known)
                    if refinement.is_promising(finer):
                        found.append(finer)
                        known = min(known, _duration(finer))
            found.sort(key=_duration)
            if not found or _duration(found[0]) > (1.0 - WORTHWHILE) * _duration(paths[0]):
                return found
            paths = found
        return paths

    def _plan(self, found: FlownPath, durations: tuple[float, ...]) -> Plan:
        """The plan of what was found, with more room in gates and more reserve if its flight wants them."""
        flown = found.through_gates()
        if self.reserve > 0.0:
            flown = flown.with_reserves()
        return flown.judged.plan(
            flown.refinement.recorder,
            planner="time-optimal",
            order=5,
            status=flown.judged.solution.status,
            backend="builtin",
            stages=flown.judged.solution.source.placed,
            starts=durations,
        )


def _likeliest(begun: tuple[Plan | None, WarmStart]) -> tuple[bool, float]:
    """The key that sorts paths: certified plans first, the shortest of them foremost."""
    plan, path = begun
    return plan is None or not plan.certified, path.trajectory.duration


def _varied(begun: Sequence[tuple[Plan | None, WarmStart]]) -> Iterator[WarmStart]:
    """Yield paths, those that know no rotors also slower, then all at paces that are drawn, without end.

    After each that nearly lies in a vertical plane comes the same bent out of it.
    """
    sources: list[WarmStart] = []
    for plan, path in begun:
        sources.append(path)
        if plan is None or plan.vehicle is None:
            sources.append(path.time_scaled(SLOWER))
    paced, rng = sources, np.random.default_rng(SEED)
    while sources:
        for path in paced:
            yield path
            plane = path.plane()
            if plane is not None:
                yield path.bent(ASIDE * path.extent * plane)
        paced = [
            path.at_other_pace(np.exp(rng.normal(0.0, PACE_SPREAD, len(path.phases)))) for path in sources
        ]


def _rough(refinement: Refinement, paths: Sequence[WarmStart]) -> list[RefinedPath]:
    """The rough paths near starts, without those that lose their way, the fastest first."""
    found: list[RefinedPath] = []
    segments = segments_for(refinement.task.stages)
    for path in paths:
        rough = refinement.rough(path, segments, min(map(_duration, found), default=inf))
        if refinement.is_promising(rough):
            found.append(rough)
        if found and out_of_time():
            break
    return sorted(found, key=_duration)


def _distinct(paths: Sequence[RefinedPath]) -> list[RefinedPath]:
    """Sorted paths without those that take nearly as long as the one before."""
    before = [0.0, *map(_duration, paths)]
    return [each for each, last in zip(paths, before, strict=False) if _duration(each) > (1.0 + SAME) * last]


def _duration(path: RefinedPath) -> float:
    return path.path.trajectory.duration


def _is_clear(plan: Plan) -> bool:
    """True of a plan whose body is clear of the frames of gates."""
    return plan.certificate is not None and is_clear(plan.certificate.frames)
