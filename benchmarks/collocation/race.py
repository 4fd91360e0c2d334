"""The race of starts: all on a coarse mesh, the best on a fine one, the fastest that is certified wins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from aerobat.limits.body_in_gate import BodyInGate
from aerobat.optimization.deadline import out_of_time, within_share
from aerobat.planning.certified_solve import Judged, certified_solve
from aerobat.planning.courses import is_course
from aerobat.planning.flyability import OwnFlight, own_flight
from aerobat.planning.gate_clearance import cleared, more_direct
from aerobat.planning.recorder import Attempt, Recorder
from aerobat.planning.task import Task
from aerobat.vehicle import Vehicle
from collocation.collocated_program import CollocatedProgram, SolvedMotion
from collocation.optimal_control.elements import Elements
from collocation.start import MIN_INTERVALS, Start, allocate_intervals

COARSE_INTERVALS = 24  # in all, of first solves, whose durations come a few percent too long
COARSE_MIN_INTERVALS = 2  # of a phase
COARSE_ITERATIONS = 150  # at most: what takes longer is no start
COARSE_TOLERANCE = 1e-4
COARSE_VIOLATION = 1e-2  # of constraints, at most: enough to begin the fine solve from
FINALISTS = 2  # in a plane and in space each, the fastest on the coarse mesh, to be solved on the fine one
SAME = 1e-3  # of the duration: starts that come to nearly the same have come to the same motion
# on a course, whose legs take turns at the full body rate: intervals of a leg on either mesh,
COURSE_COARSE_INTERVALS = 12
COURSE_INTERVALS = 20
COURSE_COARSE_ITERATIONS = 250  # at most, of first solves
COURSE_BARRIER = 1e-3  # of solves on the fine one, which begin near the solution
ROUNDS = 8  # of solving, at most
MORE_RESERVE = 1.6  # times the reserve, each time that the plan's own flight leaves its path
RESERVE_RAISES = 4  # at most
MAX_RESERVE = 0.4
COARSE_TIME = 0.4  # of the time that is left, where there is a limit, for all coarse solves,
AHEAD_TIME = 0.7  # of what is left then for the first of each fine one


@dataclass
class Race:
    """One run of the planner."""

    task: Task
    recorder: Recorder
    intervals: int  # of the fine mesh
    iterations: int  # of each solve, at most
    durations: tuple[float, ...] = ()  # [s] that starts came to on the coarse mesh, rising
    _elements: dict[tuple[bool, bool], Elements] = field(default_factory=dict)

    @cached_property
    def on_course(self) -> bool:
        """True of a course, whose starts lead to much the same motion: the first that converges will do."""
        return is_course(self.task.stages)

    def winner(self, starts: Sequence[Start], body: Vehicle) -> Judged[SolvedMotion] | None:
        """The fastest that is certified, of the finalists; of the others the first, if none of them is.

        Args:
            starts: Where to begin.
            body: The vehicle, or one much like it that is easier to plan for.
        """
        with within_share(COARSE_TIME):
            finalists, others = _finalists(self._coarse(starts, body))
        with within_share(AHEAD_TIME):
            for program in finalists:
                program.solve_ahead()
        best: Judged[SolvedMotion] | None = None
        for program in sorted(finalists, key=lambda program: program.duration):
            if best is None or program.duration < best.solution.duration:
                found = self._certified(program)
                if found is not None and (best is None or found.solution.duration < best.solution.duration):
                    best = found
        return best or next(filter(None, map(self._certified, others)), None)

    def flyable(self, found: Judged[SolvedMotion]) -> Judged[SolvedMotion]:
        """Return the motion found, refined until its flight has no defect.

        The motion is made more direct through gates, then given more reserve. Where no reserve is wanted the
        reserve stays as it is, and where none is enough the best motion is returned.
        """
        found, reserve = cleared(found, self._more_direct), self.task.reserve
        best = self._own_flight(found), found
        for _ in range(RESERVE_RAISES if reserve > 0.0 else 0):
            if not best[0].wants_reserve or out_of_time():
                break
            reserve = min(MORE_RESERVE * reserve, MAX_RESERVE)
            last = found.solution.source
            again = self._certified(self._fine(last.program.control.elements, last, reserve))
            if again is not None:
                found = again
                best = min(best, (self._own_flight(found), found), key=lambda pair: pair[0].rank)
        return best[1]

    def _more_direct(self, found: Judged[SolvedMotion]) -> Judged[SolvedMotion] | None:
        """What is found with more room in the gates whose frames are not clear, if anything is."""
        solved = found.solution.source
        before, control = solved.program.start.in_gates, solved.program.control
        in_gates = more_direct(before, control.stages, self.task, found.frames)
        if in_gates == before:
            return None
        return self._certified(self._fine(control.elements, solved, self.task.reserve, in_gates))

    def _coarse(self, starts: Sequence[Start], body: Vehicle) -> list[CollocatedProgram]:
        """Fine programs from where coarse ones end, the fastest first."""
        ended: list[CollocatedProgram] = []
        for start in starts:
            if ended and (self.on_course or out_of_time()):
                break
            elements = self._elements_for(start, body)
            solved = CollocatedProgram(
                elements,
                start,
                self.task.reserve,
                elements.mesh(self._coarse_intervals(start)),
                min(COURSE_COARSE_ITERATIONS if self.on_course else COARSE_ITERATIONS, self.iterations),
                COARSE_TOLERANCE,
            ).solved()
            usable = solved.answer.violation < COARSE_VIOLATION
            if self.on_course:  # where its legs trade with each other, what has not converged is far off
                usable = solved.answer.converged
            self._record(solved, usable)
            if usable:
                ended.append(self._fine(elements, solved, self.task.reserve))
        ended.sort(key=lambda program: program.duration)
        self.durations = tuple(program.duration for program in ended)
        return ended

    def _coarse_intervals(self, start: Start) -> tuple[int, ...]:
        if self.on_course:
            legs = len(start.guess.phases)
            return allocate_intervals(start.guess, COURSE_COARSE_INTERVALS * legs, MIN_INTERVALS)
        return allocate_intervals(start.guess, min(COARSE_INTERVALS, self.intervals), COARSE_MIN_INTERVALS)

    def _fine(
        self,
        elements: Elements,
        solved: SolvedMotion,
        reserve: float,
        in_gates: tuple[BodyInGate, ...] | None = None,
    ) -> CollocatedProgram:
        """The program on the fine mesh from a motion, with the same room in gates or another."""
        start = solved.start if in_gates is None else replace(solved.start, in_gates=in_gates)
        if not self.on_course:
            mesh = elements.mesh(allocate_intervals(start.guess, self.intervals, MIN_INTERVALS))
            return CollocatedProgram(elements, start, reserve, mesh, self.iterations)
        intervals = max(self.intervals, COURSE_INTERVALS * len(solved.motion.phases))
        mesh = solved.program.mesh.refined(solved.motion, intervals, MIN_INTERVALS)
        return CollocatedProgram(elements, start, reserve, mesh, self.iterations, barrier=COURSE_BARRIER)

    def _elements_for(self, start: Start, body: Vehicle) -> Elements:
        """The functions of programs in the start's plane or in space, which starts share."""
        key = start.plane is None, body is self.task.vehicle
        if key not in self._elements:
            self._elements[key] = Elements(replace(self.task, vehicle_if_any=body), start.plane)
        return self._elements[key]

    def _own_flight(self, found: Judged[SolvedMotion]) -> OwnFlight:
        solved = found.solution.source
        return own_flight(self.task, solved.trajectory, solved.placed)

    def _certified(self, program: CollocatedProgram) -> Judged[SolvedMotion] | None:
        found = certified_solve(program, self.task, self.recorder, ROUNDS)
        return found.at(found.solution.source.placed) if found.feasible else None

    def _record(self, solved: SolvedMotion, usable: bool) -> None:
        duration, answer = float(solved.motion.phases.sum()), solved.answer
        ended = f"{duration:.3f} s on a coarse mesh" if usable else solved.failure
        attempt = Attempt(
            duration=duration,
            feasible=False,
            status="unknown",
            outcome=f"from {solved.program.start.origin}: {ended}",
            cost=duration if usable else None,
            nodes=answer.iterations,
            solve_time=answer.time,
        )
        self.recorder.record(attempt)


def _finalists(
    programs: Sequence[CollocatedProgram],
) -> tuple[list[CollocatedProgram], list[CollocatedProgram]]:
    """The programs to be solved finely, the fastest of each kind that came to different durations; the rest.

    In a plane and in space are two kinds: a coarse mesh is dearer to what turns about two axes.
    """
    taken: list[CollocatedProgram] = []
    for program in programs:
        alike = [p for p in taken if (p.start.plane is None) == (program.start.plane is None)]
        new = all(program.duration > (1.0 + SAME) * p.duration for p in alike)
        if new and len(alike) < FINALISTS:
            taken.append(program)
    return taken, [program for program in programs if program not in taken]


def with_smoother(vehicle: Vehicle, lag: float) -> tuple[Vehicle, ...]:
    """The vehicle; if its rotors have no lag, next one of so much [s]: jumping thrusts are harder to find."""
    if vehicle.lags.any():
        return (vehicle,)
    rotors = tuple(replace(rotor, lag=lag) for rotor in vehicle.rotors)
    return vehicle, replace(vehicle, rotors=rotors)
