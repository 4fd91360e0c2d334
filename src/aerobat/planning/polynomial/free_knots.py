"""Polynomials whose knots are free: nearly time-optimal, certified, from a closed form or the paper's MIQP.

Degree 9 as in Section V-B, but derivatives at the knots and durations are chosen by the rotors' limits, not
by a cost that knows nothing of them: that is where the closed form loses most of its time.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import inf
from typing import Annotated, ClassVar, NamedTuple

from pydantic import Field

from aerobat.declaration import AS_IT_IS, NonNegative
from aerobat.errors import Infeasible, Reason, limits_of
from aerobat.optimization.deadline import out_of_time
from aerobat.planning.around.fastest import fastest_around
from aerobat.planning.around.guesses import guesses
from aerobat.planning.assessment.assessment import SUSPICIOUS
from aerobat.planning.assessment.lower_bound import least_duration
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


@planner("free-knots")
class FreeKnots(Planner):
    """Such polynomials at the rotors' limits, derivatives and times at knots free.

    They begin from `start`, a plan of the same problem, certified or not; without one from the closed
    form through waypoints, and from the MIQP's plan where that is slow or leads nowhere. A course of many
    stages begins at the closed form through them, stretched, more so where that leads nowhere. A knot is
    at every stage. Rotors that lag are held to their limits by their commands, their thrusts continuous.
    At the ends the body does not turn, but its thrust may be changing, so that there is jerk along it,
    unless `still_ends` asks for none. A `reserve`, a fraction of the range of rotors and body rate, is
    kept from either end for the controller, proven of rotors. Around obstacles they begin from routes on
    several sides, and keep a `clearance` from them. A closed course ends in the state in which it begins,
    of position, velocity, attitude, body rates and thrusts, all of which are chosen.
    """

    PLANS_CLOSED_COURSES: ClassVar[bool] = True

    segments: Annotated[int, Field(ge=2, le=MAX_SEGMENTS)] = option(
        SEGMENTS,
        "How many polynomial segments, one a phase between stages at least. 4 are quick; 8 come closer to "
        f"time-optimal; {MAX_SEGMENTS} at most. A course has two a leg, or more.",
    )
    start: Annotated[Plan, AS_IT_IS] | None = None
    still_ends: bool = False
    reserve: Reserve = option(
        0.0,
        "The fraction of every limit of the vehicle that is kept from either of its ends for the controller; "
        "with 0 a plan of four segments or more leaves it next to nothing.",
        command_default=FLYING_RESERVE,
    )
    clearance: Clearance = option(0.0, CLEARANCE, command_default=FLYING_CLEARANCE)  # [m]
    time_limit: NonNegative | None = option(None, TIME_LIMIT)  # [s]

    def plan(
        self, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        """The fastest certified plan found; where none is faster, the plan that it began from.

        Raises SpecError without a vehicle and for input that makes no sense, Infeasible when nothing is
        certified.
        """
        task = flown_task("free-knots", problem, vehicle, self.reserve, self.clearance)
        recorder = Recorder(progress)
        refinement = Refinement.of(task, recorder, self.still_ends)
        found = best_in_time(problem, self.time_limit, recorder, lambda: self._fastest(refinement))
        if found is not None:
            return found
        last = recorder.last_outcome
        is_closed = len(task.environment.pieces) and next(guesses(task), None) is None
        where = "between obstacles no way was found, and " if is_closed else ""
        sentence = (
            f"no polynomials are certified to fly '{problem.name}' with {task.vehicle.name}: "
            f"{where}at the last attempt {last}, which does not prove that there are none; "
            "widen what binds there, or give other --segments"
        )
        raise Infeasible(Reason(sentence, limits_of(last)), recorder.attempts)

    def _fastest(self, refinement: Refinement) -> Plan | None:
        """The fastest plan from the first start that leads to one; from further ones if it is poor.

        A plan is poor whose body touches a gate's frame, or that is slow beside what is possible.
        """
        task = refinement.task
        best = self._around(refinement)
        if best is not None:
            return best.plan
        slow = SUSPICIOUS * least_duration(task.problem, task.vehicle)
        best = self._first(refinement, self._starts(refinement), slow)
        if (best is None or best.touches) and is_course(task.stages) and not out_of_time():
            best = _best(best, self._first(refinement, closed_forms(task, SLOWER_PACES), inf))
        return None if best is None else replace(best.plan, attempts=tuple(refinement.recorder.attempts))

    def _first(
        self, refinement: Refinement, begun: Iterable[tuple[Plan | None, WarmStart]], slow: float
    ) -> _Found | None:
        """The best of what is begun, up to the first clear of frames that takes no longer than `slow` [s]."""
        best: _Found | None = None
        for plan, start in begun:
            own = None if plan is None else self._as_it_is(plan, refinement)
            refined = self._refined(refinement, start)
            best = _best(best, own, refined)
            if out_of_time() or (refined is not None and plan is not None and plan is self.start):
                break
            if best is not None and not best.touches and best.duration <= slow:
                break
        return best

    def _around(self, refinement: Refinement) -> _Found | None:
        """The plan around obstacles; None where there are none, or no route leads to one."""
        task = refinement.task
        if self.start is not None or not len(task.environment.pieces):
            return None
        around = fastest_around(refinement, segments_for(task.stages, self.segments))
        return None if around is None else _found(around.refinement, around.judged)

    def _as_it_is(self, start: Plan, refinement: Refinement) -> _Found | None:
        """The plan that is begun from, where it is certified and keeps the reserve."""
        vehicle = refinement.task.vehicle
        plan = start if start.vehicle == vehicle else start.for_vehicle(vehicle)
        if not (plan.certified and plan.keeps(self.reserve)) or plan.planner == "free-knots":
            return None
        said = f"free-knots found none faster than the path that it began from, {plan.planner}'s"
        return _Found(not plan.certified, plan.duration, replace(plan, planner="free-knots", rescue=said))

    def _refined(self, refinement: Refinement, start: WarmStart) -> _Found | None:
        """The certified plan near a start; None where there is none."""
        segments = segments_for(refinement.task.stages, self.segments)
        for own in refinement.with_and_without_rooms:
            judged = own.refined(start, segments)
            if judged.feasible:
                return _found(own, judged)
            if out_of_time():
                break
        return None

    def _starts(self, refinement: Refinement) -> Iterator[tuple[Plan | None, WarmStart]]:
        """Where to begin, at a plan or at a closed form."""
        if self.start is not None:
            yield self.start, WarmStart.of(self.start, refinement.task.stages)
        yield from starts(refinement.task, Miqp(reserve=self.reserve, rescue=False, flies=False))


class _Found(NamedTuple):
    """A plan, and what it is worth: the least is the best."""

    touches: bool  # whether its body is not clear of a gate's frame
    duration: float  # [s]
    plan: Plan


def _best(*found: _Found | None) -> _Found | None:
    """The best of what was found; None where nothing was."""
    return min(filter(None, found), key=lambda each: each[:2], default=None)


def _found(refinement: Refinement, judged: Judged[RefinedPath]) -> _Found:
    """What is certified, with more room in gates where its body wants it."""
    cleared = FlownPath.of(refinement, judged).through_gates().judged
    plan = _plan(cleared, refinement.recorder)
    return _Found(not is_clear(cleared.frames), plan.duration, plan)


def _plan(judged: Judged[RefinedPath], recorder: Recorder) -> Plan:
    """The plan of what is certified."""
    return judged.plan(
        recorder,
        planner="free-knots",
        order=5,
        status=judged.solution.status,
        backend="builtin",
        stages=judged.solution.source.placed,
    )
