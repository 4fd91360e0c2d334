"""The descent of free knots from a plan: solve near it, look between samples, go on from what is certified.

Limits on a path are infinitely many constraints. They are held at samples; where the certificate or a denser
look finds one exceeded between them, that instant joins the samples, and all are held with a little more
backoff: the exchange method (Blankenship and Falk 1976) with restriction of the right-hand side, which makes
it end at a feasible point (Mitsos 2011).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerobat.certification import Certificate, Verdict
from aerobat.flatness import force_balance
from aerobat.optimization.deadline import out_of_time
from aerobat.planning.certified_solve import Judged, Solution, certified_solve
from aerobat.planning.polynomial.knot_program import KnotProgram
from aerobat.planning.polynomial.knot_samples import ConstraintViolation, chebyshev_samples, refit
from aerobat.planning.polynomial.knot_variables import Frame, KnotVariables
from aerobat.planning.polynomial.path_limits import PathLimits, bound_scale, path_bounds
from aerobat.planning.polynomial.rotor_constraints import RotorConstraints
from aerobat.planning.recorder import Recorder
from aerobat.planning.result import PlacedStage, Plan
from aerobat.planning.rotor_margin import reserve_shortfalls
from aerobat.planning.warm_start import WarmStart
from aerobat.problem.condition import ForceBalance
from aerobat.problem.problem import Problem
from aerobat.problem.stage import StageSequence
from aerobat.vehicle import Vehicle

ROUNDS = 12  # of solving, at most, from one start
LITTLE_GAIN = 0.005  # of the duration, from one certified path to the next: the end
LITTLE_LOSS = 0.02  # of the duration, that certainty between samples costs: the end if the start was near
LARGE_GAIN = 0.2  # of the duration: the start was far, trust regions confine what follows it
TRUST_RADIUS = 2.0  # in scaled variables, see KnotVariables
MIN_RADIUS = 0.2  # a smaller region may hold no path that mends what is exceeded
SHRINK = 3.0  # by how much the trust region is smaller where a limit is exceeded between samples
TRUSTED = 0.5  # of a limit's range: an excess between samples beyond it means that the solver has cheated
SOLVED = 1e-3  # the same at samples: more means that the region is too large
FIRST_BACKOFF = 1e-4  # of every limit's range, kept at samples
MAX_BACKOFF = 0.02  # that is added at once: where much is exceeded, samples mend most of it
RELATIVE_STAGE_TOLERANCE = 1e-5  # of a condition's size: by how much a stage may be missed through rounding
SLOWER = 1.2  # times the duration, each time that a start is slowed
SLOWED = 15  # times, at most
CONVERGED = "locally optimal"  # the status of such a solution


@dataclass(frozen=True, eq=False)
class Path:
    """A path with its stages, where it comes from, and what limits it exceeds at a dense look."""

    guess: WarmStart
    violation: ConstraintViolation
    start: Plan | None = None  # whose path it is, if it is another planner's
    unsolved: float = 0.0  # of a limit's range, left by the solver at samples


@dataclass(frozen=True, eq=False)
class Course:
    """What all solves from one start share: the problem in the frame of motion of that start."""

    problem: Problem
    vehicle: Vehicle
    frame: Frame
    limits: PathLimits
    balance: ForceBalance
    reserve: float  # of every limit's range, proven of rotors

    @classmethod
    def of(
        cls, problem: Problem, vehicle: Vehicle, sequence: StageSequence, guess: WarmStart, reserve: float
    ) -> Course:
        """Of a guess, in whose vertical plane all stays if it has one.

        Args:
            problem: What is planned.
            vehicle: What flies it.
            sequence: The problem's stages for it.
            guess: Where to begin.
            reserve: Of every limit's range, kept from either of its ends.
        """
        environment = problem.environment
        frame = Frame.around(guess, environment.wind)
        balance = force_balance(environment, vehicle)
        rotors = RotorConstraints(vehicle, frame.axes, environment, problem.heading)
        limits = PathLimits(rotors, frame.origin, path_bounds(problem, sequence, balance))
        return cls(problem, vehicle, frame, limits, balance, reserve)

    def path(self, guess: WarmStart, start: Plan | None = None) -> Path:
        """A guess, looked at densely."""
        return Path(guess, ConstraintViolation.of(guess.trajectory, self.limits, self.reserve), start)

    def solution(self, path: Path, status: str, nodes: int = 0, solve_time: float = 0.0) -> Solution[Path]:
        """A path as a solution; a failure where it misses a stage, or exceeds limits."""
        trajectory = path.guess.trajectory
        failure = self._missed_stage(path.guess)
        if failure is None and path.violation.worst > 0.0:
            failure = str(path.violation)
        return Solution(
            source=path,
            duration=trajectory.duration,
            trajectory=trajectory,
            status=status,
            nodes=nodes,
            solve_time=solve_time,
            cost=trajectory.duration,
            failure=failure,
        )

    def paced(self, guess: WarmStart) -> WarmStart:
        """The guess; where it exceeds limits by far, as slow as where it exceeds them least."""
        slower = [guess]
        violations = [self.path(guess).violation.worst]
        while violations[0] > TRUSTED and violations[-1] > 0.0 and len(slower) <= SLOWED:
            slower.append(slower[-1].time_scaled(SLOWER))
            violations.append(self.path(slower[-1]).violation.worst)
        return slower[int(np.argmin(violations))]

    def _missed_stage(self, guess: WarmStart) -> str | None:
        """The first stage that a guess misses, in a sentence; or None."""
        for stage, time in zip(guess.stages, guess.times, strict=True):
            flat = np.array([guess.trajectory.evaluate(time, k) for k in range(3)])
            for condition in stage.conditions:
                bound = condition.bound(self.balance)
                excess = float(bound.excess(flat))
                if excess > RELATIVE_STAGE_TOLERANCE * bound_scale(bound):
                    return f"the stage '{stage.name}' is missed by {excess:.2g} in SI units"
            fraction, (earliest, latest) = time / guess.trajectory.duration, stage.window
            if max(earliest - fraction, fraction - latest) > RELATIVE_STAGE_TOLERANCE:
                return f"the stage '{stage.name}' is passed at {fraction:.3g} of the duration, not when asked"
        return None


@dataclass
class Descent:
    """One descent, and the best that is certified."""

    course: Course
    recorder: Recorder
    still_ends: bool
    iterations: int  # of each solve, at most
    best: Judged[Path] | None = None

    def consider(self, start: Plan, guess: WarmStart) -> None:
        """Keep the path of another planner's plan, as it is, where it is certified."""
        self._certified(_Start(self.course, start, guess), 1)

    def run(self, guess: WarmStart, segments: int) -> None:
        """Free the knots of a path, or of the best that is certified, with so many segments."""
        guess = guess if self.best is None else self.best.solution.source.guess
        guess = self.course.paced(replace(guess, trajectory=refit(guess.trajectory, segments)))
        program, end = _Exchange(self, guess), len(self.recorder.attempts) + ROUNDS
        while (left := end - len(self.recorder.attempts)) > 0 and not out_of_time():
            before = program.guess.trajectory.duration
            if (found := self._certified(program, left)) is None or program.little_to_gain(found, before):
                return
            program.go_on_from(found.solution.source.guess)

    def plan(self, segments: int) -> Plan | None:
        """The plan of what is certified, its start's path where that is the best; None if nothing is.

        It says so where the best has not so many `segments`.
        """
        if self.best is None:
            return None
        path, start = self.best.solution.source.guess, self.best.solution.source.start
        numbers = np.searchsorted(path.trajectory.knots[1:-1], path.times, side="right").tolist()
        stages = zip(path.stages, numbers, path.times, strict=True)
        return self.best.plan(
            self.recorder,
            planner="free-knots",
            order=5 if start is None else start.order,
            status=CONVERGED if start is None else "feasible",
            backend="ipopt" if start is None else start.backend,
            stages=tuple(PlacedStage(s.name, segment, time, s.gate) for s, segment, time in stages),
            rescue=_instead(start, path.trajectory.segments, segments),
        )

    def _certified(self, program: _Start | _Exchange, rounds: int) -> Judged[Path] | None:
        """Outcome of a program, if it is certified; the best is kept."""
        course = self.course
        found = certified_solve(
            program, course.problem, course.vehicle, self.recorder, rounds, reserve=course.reserve
        )
        if not found.feasible:
            return None
        if self.best is None or found.solution.duration < self.best.solution.duration:
            self.best = found
        return found


def _instead(start: Plan | None, found: int, asked: int) -> str:
    """A sentence about what is returned instead of a path of so many segments, if anything is."""
    if start is not None:
        return f"free-knots found none faster than the path that it began from, {start.planner}'s"
    if found != asked:
        return f"free-knots found none faster with {asked} segments; planned with {found}"
    return ""


@dataclass
class _Start:
    """The path of another planner's plan, as it is."""

    course: Course
    start: Plan
    guess: WarmStart

    def solve(self) -> Solution[Path]:
        """The path."""
        return self.course.solution(self.course.path(self.guess, self.start), "feasible")

    def tighten(self, solution: Solution[Path], certificate: Certificate | None) -> bool:
        """Nothing can be tightened."""
        return False


class _Exchange:
    """The program near a guess, with limits at samples, which counterexamples join as they are found."""

    def __init__(self, descent: Descent, guess: WarmStart) -> None:
        self.guess = guess
        self._descent = descent
        self._begun = guess.trajectory.duration
        self._samples = chebyshev_samples(guess.trajectory.segments)
        self._radius = TRUST_RADIUS
        self._backoff = FIRST_BACKOFF + descent.course.reserve
        self._relaxed: float | None = None  # [s] the duration of the first solution near the guess

    def solve(self) -> Solution[Path]:
        """The fastest path within the trust region around the guess."""
        descent, course = self._descent, self._descent.course
        segments = np.searchsorted(self.guess.trajectory.knots[1:-1], self.guess.times, side="right")
        variables = KnotVariables(
            problem=course.problem,
            vehicle=course.vehicle,
            guess=self.guess,
            segments=tuple(segments.tolist()),
            frame=course.frame,
            radius=self._radius,
            still_ends=descent.still_ends,
        )
        program = KnotProgram(variables, course.limits, self._samples, course.balance, self._backoff)
        found, answer = program.solve(descent.iterations)
        status = CONVERGED if answer.converged else "unknown"
        path = replace(course.path(found), unsolved=answer.violation)
        if self._relaxed is None:
            self._relaxed = found.trajectory.duration
        return course.solution(path, status, answer.iterations, answer.time)

    def little_to_gain(self, found: Judged[Path], before: float) -> bool:
        """True if what is certified is hardly faster than before, or as fast as where samples alone count."""
        duration, relaxed = found.solution.duration, self._relaxed or 0.0
        near = duration >= (1.0 - LARGE_GAIN) * self._begun
        settled = near and duration <= (1.0 + LITTLE_LOSS) * relaxed
        return settled or duration >= (1.0 - LITTLE_GAIN) * before

    def go_on_from(self, certified: WarmStart) -> None:
        """Begin again from a certified path, in the whole trust region and with the least backoff."""
        self.guess = certified
        self._relaxed = None
        self._radius = TRUST_RADIUS
        self._backoff = FIRST_BACKOFF + self._descent.course.reserve

    def tighten(self, solution: Solution[Path], certificate: Certificate | None) -> bool:
        """Sample where limits are exceeded, and go on from there in a smaller region.

        A path slower than the best that is certified is given up: tightening only slows it further.
        """
        best, course, path = self._descent.best, self._descent.course, solution.source
        if out_of_time():
            return False
        solved = path.unsolved <= SOLVED
        converged = solution.status == CONVERGED
        if converged and best is not None and solution.duration >= best.solution.duration:
            return False
        violation = path.violation
        for finding in () if certificate is None else certificate.findings:
            if finding.verdict is not Verdict.HOLDS:
                violation = violation.add_counterexample(path.guess.trajectory, finding.time)
        for shortfall in () if certificate is None else reserve_shortfalls(certificate, course.reserve):
            violation = violation.add_counterexample(path.guess.trajectory, shortfall.finding.time)
        self._samples = violation.joined(self._samples)
        if not solved and self._radius <= MIN_RADIUS:
            return False
        if not (solved and converged) or violation.worst > 0.0:
            self._radius = max(self._radius / SHRINK, MIN_RADIUS)
        if solved and violation.worst <= TRUSTED:
            self.guess = path.guess
            self._backoff += min(max(violation.worst, FIRST_BACKOFF) / 2.0, MAX_BACKOFF)
        return True
