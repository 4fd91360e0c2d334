"""Polynomials whose knots are free: nearly time-optimal, certified, from the paper's search or its MIQP.

Degree 9 as in Section V-B, but derivatives at the knots and durations are chosen by the rotors' limits, not
by a cost that knows nothing of them: that is where the closed form loses most of its time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING, Annotated, ClassVar

from pydantic import Field

from aerobat.declaration import AS_IT_IS, Count, NonNegative
from aerobat.errors import Infeasible, Reason, limits_of
from aerobat.limits.body_in_gate import BodyInGate
from aerobat.optimization.deadline import out_of_time, within_time
from aerobat.optimization.nonlinear import import_casadi
from aerobat.planning.assessment.assessment import SUSPICIOUS
from aerobat.planning.assessment.lower_bound import least_duration
from aerobat.planning.courses import is_course
from aerobat.planning.gate_clearance import bodies_in_gates
from aerobat.planning.miqp import Miqp
from aerobat.planning.planners import Planner, option, planner
from aerobat.planning.polynomial.knots import start_along_normals
from aerobat.planning.polynomial.min_snap import MinSnap
from aerobat.planning.recorder import Progress, Recorder
from aerobat.planning.result import FLYING_RESERVE, Plan
from aerobat.planning.time_limit import TIME_LIMIT, stopped, too_short
from aerobat.planning.warm_start import Reserve, WarmStart, plans_to_begin_from, require_attitudes
from aerobat.problem.problem import Problem
from aerobat.problem.stage import StageSequence
from aerobat.vehicle import Vehicle

if TYPE_CHECKING:  # what it takes to plan is imported then: the options are those of every command that plans
    from aerobat.planning.polynomial.descent.knot_descent import Descent, Strategy

MAX_SEGMENTS = 24  # a judgement: more gain next to nothing, and a solve takes longer with each
LEG_SEGMENTS = 2  # of a course's leg, where that makes no more than MAX_COURSE_SEGMENTS, else one
MAX_COURSE_SEGMENTS = 26  # of thirteen legs: a minute
START_ORDERS = (3, 4)  # of closed forms that courses begin at: minimum jerk, minimum snap
COURSE_ITERATIONS = 150  # of a solve at most, for all segments of a course at once
MAX_LEG_SEGMENTS = 3  # of a course's legs on average, where one begins near a motion
FIT = 0.08  # of the largest specific thrust: polynomials so near to a motion can turn as it does
COARSE = 4  # segments to begin with where there shall be more: they are quick and come near the least time


@planner("free-knots")
class FreeKnots(Planner):
    """Such polynomials at the rotors' limits, derivatives and times at knots free; needs the extra casadi.

    It begins from `start`, a plan of the same problem, certified or not; without one from the closed form
    through waypoints, or else from the MIQP's plan. Stages hold anywhere in their order and their windows;
    two segments have room for a flip's five. A course of many stages begins near the rigid body's motion on a
    coarse mesh, with as many segments a leg as it turns sharply, or else, and without rotor lag, at the
    closed form through its stages, stretched, with one or two a leg. Rotors that lag are held to their limits
    by their commands, their thrusts continuous. At the ends the body does not turn, but its thrust may be
    changing, so that there is jerk along it, unless `still_ends` asks for none. A `reserve`, a fraction of
    the range of rotors and body rate, is kept from either end for the controller, proven of rotors: without
    one, four segments leave rotors without lag, whose thrusts may jump, 13 cm off the paper's second example;
    one percent makes that 4 mm.
    """

    segments: Annotated[int, Field(ge=2, le=MAX_SEGMENTS)] = option(
        COARSE,
        "How many polynomial segments. 2 leaves something to the controller; 8 comes closer to time-optimal "
        f"and takes longer; {MAX_SEGMENTS} at most. A course has one a leg, or more.",
    )
    start: Annotated[Plan, AS_IT_IS] | None = None
    still_ends: bool = False
    reserve: Reserve = option(
        0.0,
        "The fraction of every limit of the vehicle that is kept from either of its ends for the controller; "
        "with 0 a plan of four segments or more leaves it next to nothing.",
        command_default=FLYING_RESERVE,
    )
    iterations: Count = 50  # at most, each solve
    time_limit: NonNegative | None = option(None, TIME_LIMIT)  # [s]
    COMPARED: ClassVar[tuple[dict[str, int], ...]] = ({"segments": 2}, {"segments": 8})

    def plan(
        self, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        """The fastest certified plan found; where none is faster, one of fewer segments, or the plan that it
        began from, which `rescue` then says.

        Raises SpecError without a vehicle and for input that makes no sense, Infeasible when nothing is
        certified, BackendMissing without CasADi.
        """
        vehicle = require_attitudes("free-knots", problem, vehicle)
        import_casadi()
        sequence = problem.stages(vehicle.max_specific_thrust, vehicle.body_radius)
        recorder = Recorder(progress)
        with within_time(self.time_limit):
            found = self._planned(problem, vehicle, sequence, recorder)
            if found is not None:
                return stopped(found)
            if out_of_time():
                raise too_short(problem, self.time_limit, recorder.attempts)
        last = recorder.attempts[-1].outcome
        sentence = (
            f"no polynomials are certified to fly '{problem.name}' with {vehicle.name}: at the last attempt "
            f"{last}; widen what binds there, or give other --segments"
        )
        raise Infeasible(Reason(sentence, limits_of(last)), recorder.attempts)

    def _planned(
        self, problem: Problem, vehicle: Vehicle, sequence: StageSequence, recorder: Recorder
    ) -> Plan | None:
        """The fastest certified plan; where its flight hits a frame, one with room in all gates at first.

        A long course has room in most of them at once.
        """
        most, every = (
            bodies_in_gates(sequence.stages, problem, vehicle, everywhere) for everywhere in (False, True)
        )
        task = problem, vehicle, sequence, recorder
        on_course = is_course(sequence)
        starts = self._on_course(*task, most) if on_course else self._on_maneuver(*task)
        found, clears = self._best(starts, *task)
        has_no_other = len(most) == len(every) if on_course else not sequence.ordered
        if found is None or clears or has_no_other or out_of_time():
            return found
        again, clears = self._best(self._on_course(*task, every), *task)
        return again if clears else found

    def _best(
        self,
        starts: Iterator[_Start],
        problem: Problem,
        vehicle: Vehicle,
        sequence: StageSequence,
        recorder: Recorder,
    ) -> tuple[Plan | None, bool]:
        """The fastest certified plan from the first start that leads to one; from further ones if it is poor.

        A poor start leads to a poor optimum, or to none; an optimum from the MIQP's plan is taken, from
        another start one that is not slow beside what is possible.

        Args:
            starts: Where to begin.
            problem: What is planned.
            vehicle: What flies it.
            sequence: The problem's stages for it.
            recorder: Keeps an attempt a solve.

        Returns:
            The plan, and whether its own flight passes all gates.
        """
        best: Plan | None = None
        clears = False
        for start in starts:
            numbers = start.numbers
            descent = self._descent(problem, vehicle, sequence, start, recorder)
            if start.plan is not None:
                descent.consider(start.plan, WarmStart.of(start.plan, sequence))
            for segments in numbers:
                if not out_of_time():
                    descent.run(start.guess, segments)
            if descent.best is None and not (start.on_course or out_of_time()):
                descent.run(start.guess, 2 * numbers[-1])
            found, passes = descent.through_gates(numbers[-1])
            if found is not None and (best is None or (passes, -found.duration) > (clears, -best.duration)):
                best, clears = found, passes
            taken = start.plan is None or start.plan is self.start
            near = descent.converged and start.plan is not None and start.plan.planner == "miqp"
            if out_of_time() or (
                best is not None and (taken or near or (descent.converged and not _slow(best, vehicle)))
            ):
                break
        return best, clears

    def _descent(
        self,
        problem: Problem,
        vehicle: Vehicle,
        sequence: StageSequence,
        start: _Start,
        recorder: Recorder,
    ) -> Descent:
        """The descent from a start."""
        from aerobat.planning.polynomial.descent.framed_problem import FramedProblem
        from aerobat.planning.polynomial.descent.knot_descent import Descent

        iterations = COURSE_ITERATIONS if start.on_course else self.iterations
        framed = FramedProblem.of(problem, vehicle, sequence, start.guess, self.reserve, start.in_gates)
        return Descent(framed, recorder, self.still_ends, iterations, start.strategy)

    def _on_course(
        self,
        problem: Problem,
        vehicle: Vehicle,
        sequence: StageSequence,
        recorder: Recorder,
        in_gates: tuple[BodyInGate, ...],
    ) -> Iterator[_Start]:
        """Where to begin on a course: near a motion of the rigid body, given or its own; at closed forms.

        Without lag thrusts jump in such a motion: smooth polynomials begin nearer at the closed form.

        Args:
            problem: What is planned.
            vehicle: What flies it.
            sequence: The problem's stages for it.
            recorder: Keeps an attempt a solve.
            in_gates: The body's room in gates, from the start.
        """
        from aerobat.planning.polynomial.descent.knot_descent import NEAR_MOTIONS, OF_COURSES
        from aerobat.planning.polynomial.nearest import nearest_polynomials
        from aerobat.planning.time_optimal.race import coarse_motion

        legs = len(sequence.stages) + 1
        allowed = FIT * vehicle.max_specific_thrust
        motion = None if self.start is None else WarmStart.of(self.start, sequence)
        if motion is None and vehicle.lags.any():
            motion = coarse_motion(problem, vehicle, recorder, self.reserve, in_gates)
        if motion is not None:
            guess = nearest_polynomials(motion, allowed, MAX_LEG_SEGMENTS * legs)
            number = max(self.segments, guess.trajectory.segments)
            yield _Start(self.start, guess, (number,), NEAR_MOTIONS, True, in_gates)
        of_leg = LEG_SEGMENTS if LEG_SEGMENTS * legs <= MAX_COURSE_SEGMENTS else 1
        for order in START_ORDERS:
            guess = start_along_normals(problem, vehicle, sequence, order)
            yield _Start(None, guess, (max(self.segments, of_leg * legs),), OF_COURSES, True, in_gates)

    def _on_maneuver(
        self, problem: Problem, vehicle: Vehicle, sequence: StageSequence, recorder: Recorder
    ) -> Iterator[_Start]:
        """Where to begin elsewhere: at plans, the best first."""
        from aerobat.planning.polynomial.descent.knot_descent import OF_MANEUVERS

        numbers = tuple(sorted({min(COARSE, self.segments), self.segments}))
        given = () if self.start is None else (self.start,)
        for plan in chain(given, self._plans(problem, vehicle)):
            yield _Start(plan, WarmStart.of(plan, sequence), numbers, OF_MANEUVERS)

    def _plans(self, problem: Problem, vehicle: Vehicle) -> Iterator[Plan]:
        """Other planners' plans to begin from; the last knows no rotors."""
        closed_form: list[Planner] = [MinSnap()] if problem.maneuver.through_points else []
        yield from plans_to_begin_from(closed_form, problem, vehicle)
        for reserve in (self.reserve, 0.0 if self.reserve > 0.0 else FLYING_RESERVE):
            start = Miqp(reserve=reserve, rescue=False, shortens=False)
            yield from plans_to_begin_from([start], problem, vehicle)
        if not out_of_time():
            yield Miqp().plan(problem)


@dataclass(frozen=True, eq=False)
class _Start:
    """Where a descent begins, with the plan whose path it is if there is one."""

    plan: Plan | None
    guess: WarmStart
    numbers: tuple[int, ...]  # of segments, to begin with and in the end
    strategy: Strategy
    on_course: bool = False
    in_gates: tuple[BodyInGate, ...] = ()  # the body's room in them, from the start


def _slow(plan: Plan, vehicle: Vehicle) -> bool:
    """True for a plan that takes suspiciously long beside its proven lower bound."""
    return plan.duration > SUSPICIOUS * least_duration(plan.problem, vehicle)
