"""Polynomials whose knots are free: nearly time-optimal, certified, from the paper's search or its MIQP.

Degree 9 as in Section V-B, but derivatives at the knots and durations are chosen by the rotors' limits, not
by a cost that knows nothing of them: that is where the closed form loses most of its time.

Limits on a path are infinitely many constraints. They are held at samples; where the certificate or a denser
look finds one exceeded between them, that instant joins the samples, and all are held with a little more
backoff: the exchange method (Blankenship and Falk 1976) with restriction of the right-hand side, which makes
it end at a feasible point (Mitsos 2011).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from aerobat.certification import Certificate, Verdict
from aerobat.declaration import AS_IT_IS, Count
from aerobat.errors import Infeasible
from aerobat.optimization.nonlinear import import_casadi
from aerobat.planning.certified_solve import Judged, Solution, certified_solve
from aerobat.planning.miqp import Miqp
from aerobat.planning.planners import Planner, option, planner
from aerobat.planning.polynomial.knot_bounds import Bound, path_bounds
from aerobat.planning.polynomial.knot_program import KnotProgram
from aerobat.planning.polynomial.knot_samples import ConstraintViolation, refit
from aerobat.planning.polynomial.min_snap import MinSnap
from aerobat.planning.recorder import Progress, Recorder
from aerobat.planning.result import PlacedStage, Plan
from aerobat.planning.warm_start import Reserve, WarmStart, plans_to_begin_from, require_attitudes
from aerobat.problem.problem import Problem
from aerobat.vehicle import Vehicle

COARSE = 2  # segments to begin with, which are quick and come near the least time
ROUNDS = 30  # of solving, at most, for one number of segments
LITTLE_GAIN = 2e-3  # of the duration, from one certified path to the next: the end
COARSE_SAMPLES = 25  # of each segment at first
FINE_SAMPLES = 16  # of each of more segments, which turn less
TRUST_RADIUS = 2.0  # of all segments together, in scaled variables, see KnotVariables
MIN_RADIUS = 0.03  # a smaller region may hold no path that mends what is exceeded
TRUSTED = 0.1  # of a limit's range: an excess between samples beyond it means that the solver has cheated
SHRINK = 4.0  # by how much the trust region is smaller then (Nocedal and Wright, algorithm 4.1)
MENDABLE = 0.015  # of a limit's range: an excess that half as much backoff mends
SOLVED = 1e-4  # the same at samples, where little is left to gain: more means that the region is too large
FIRST_BACKOFF = 1e-4  # of every limit's range, kept at samples
RELATIVE_STAGE_TOLERANCE = 1e-5  # of a condition's size: by how much a stage may be missed through rounding
SLOWER = 1.2  # times the duration, each time that a start is slowed
SLOWED = 15  # times, at most


@planner("free-knots")
class FreeKnots(Planner):
    """Such polynomials at the rotors' limits, derivatives and times at knots free; needs the extra casadi.

    It begins from `start`, a plan of the same problem, certified or not; without one from the closed form
    through waypoints, or else from the MIQP's plan. Stages hold anywhere in their order; two segments have
    room for a flip's five. At the ends the body does not turn, but its thrust may be changing, so that there
    is jerk along it, unless `still_ends` asks for none. A `reserve`, a fraction of every limit's range, is
    kept at samples from either end, for the controller: eight segments without one leave it none.
    """

    segments: Annotated[int, Field(ge=COARSE)] = option(
        COARSE,
        "How many polynomial segments. 2 is quick and leaves something to the controller; 8 come closer to "
        "time-optimal.",
    )
    start: Annotated[Plan, AS_IT_IS] | None = None
    still_ends: bool = False
    reserve: Reserve = option(
        0.0, "The fraction of every limit's range that is kept from either of its ends for the controller."
    )
    iterations: Count = 50  # at most, each solve
    COMPARED: ClassVar[tuple[dict[str, int], ...]] = ({"segments": 2}, {"segments": 8})

    def plan(
        self, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        """The fastest certified plan found; the plan that it began from, where none is faster.

        Raises SpecError without a vehicle and for input that makes no sense, Infeasible when nothing is
        certified, BackendMissing without CasADi.
        """
        vehicle = require_attitudes("free-knots", problem, vehicle)
        import_casadi()
        sequence = problem.stages(vehicle.max_specific_thrust)
        bounds = path_bounds(problem, sequence, problem.environment.gravity)
        descent = _Descent(self, problem, vehicle, bounds, Recorder(progress))
        for start in self._starts(problem, vehicle):
            descent.run(start, WarmStart.of(start, sequence))
            if descent.best is not None:
                return descent.plan(descent.best)
        attempts = descent.recorder.attempts
        raise Infeasible(
            f"no polynomials are certified to fly '{problem.name}' with {vehicle.name}: at the last attempt "
            f"{attempts[-1].outcome}; give more segments, or ask less of stages and limits",
            attempts,
        )

    def _starts(self, problem: Problem, vehicle: Vehicle) -> Iterator[Plan]:
        """Plans to begin from, the best first; the last knows no rotors."""
        if self.start is not None:
            yield self.start
        closed_form: list[Planner] = [MinSnap()] if problem.maneuver.through_points else []
        yield from plans_to_begin_from([*closed_form, Miqp(rescue=False)], problem, vehicle)
        yield Miqp().plan(problem)


@dataclass(frozen=True, eq=False)
class _Path:
    """A path with its stages, where it comes from, and what limits it exceeds at a dense look."""

    guess: WarmStart
    violation: ConstraintViolation
    start: Plan | None = None  # whose path it is, slowed down or not, if it is another planner's
    unsolved: float = 0.0  # of a limit's range, left by the solver at samples


@dataclass
class _Descent:
    """One run of the planner: what all solves share, and the best that is certified."""

    config: FreeKnots
    problem: Problem
    vehicle: Vehicle
    bounds: tuple[Bound, ...]
    recorder: Recorder
    best: Judged[_Path] | None = None

    def run(self, start: Plan, guess: WarmStart) -> None:
        """Free the knots of a plan: first of few segments, then of as many as are wanted."""
        found = self._certified(_SlowedStart(self, start, guess), SLOWED + 1)
        if found is not None:
            guess = found.solution.source.guess
        for segments in sorted({COARSE, self.config.segments}):
            program = _Exchange(self, replace(guess, trajectory=refit(guess.trajectory, segments)))
            gain, end = 1.0, len(self.recorder.attempts) + ROUNDS
            while gain > LITTLE_GAIN and (left := end - len(self.recorder.attempts)) > 0:
                before, found = program.guess, self._certified(program, left)
                if found is None:
                    break
                program.go_on_from(found.solution.source.guess)
                gain = 1.0 - found.solution.duration / before.trajectory.duration
            guess = program.guess

    def plan(self, found: Judged[_Path]) -> Plan:
        """The plan of what is certified; its start's path, where that is the best."""
        path, start = found.solution.source.guess, found.solution.source.start
        segments = np.searchsorted(path.trajectory.knots[1:-1], path.times, side="right").tolist()
        stages = zip(path.stages, segments, path.times, strict=True)
        return found.plan(
            self.recorder,
            planner="free-knots",
            order=5 if start is None else start.order,
            status="locally optimal" if start is None else "feasible",
            backend="ipopt" if start is None else start.backend,
            stages=tuple(PlacedStage(s.name, segment, time, s.gate) for s, segment, time in stages),
        )

    def path(self, guess: WarmStart, start: Plan | None = None, unsolved: float = 0.0) -> _Path:
        """A guess, looked at densely."""
        environment = self.problem.environment
        violation = ConstraintViolation.of(guess.trajectory, self.vehicle, environment, self.bounds)
        return _Path(guess, violation, start, unsolved)

    def solution(self, path: _Path, status: str, nodes: int = 0, solve_time: float = 0.0) -> Solution[_Path]:
        """A path as a solution; a failure where it misses a stage, or exceeds limits by far."""
        trajectory = path.guess.trajectory
        failure = self._missed_stage(path.guess)
        if failure is None and path.violation.worst > TRUSTED:
            failure = f"a limit is exceeded by {100.0 * path.violation.worst:.0f} % of its range"
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

    def _certified(self, program: _SlowedStart | _Exchange, rounds: int) -> Judged[_Path] | None:
        """Outcome of a program, if it is certified; the best is kept."""
        found = certified_solve(program, self.problem, self.vehicle, self.recorder, rounds)
        if not found.feasible:
            return None
        if self.best is None or found.solution.duration < self.best.solution.duration:
            self.best = found
        return found

    def _missed_stage(self, guess: WarmStart) -> str | None:
        """The first stage that a guess misses, in a sentence; or None."""
        for stage, time in zip(guess.stages, guess.times, strict=True):
            for condition in stage.conditions:
                bound = Bound.of(condition, self.problem.environment.gravity)
                excess = bound.excess_at(guess.trajectory, time)
                if excess > RELATIVE_STAGE_TOLERANCE * bound.scale:
                    return f"the stage '{stage.name}' is missed by {excess:.2g} in SI units"
        return None


@dataclass
class _SlowedStart:
    """The path of another planner's plan, slower each time that it is refuted."""

    descent: _Descent
    start: Plan
    guess: WarmStart

    def solve(self) -> Solution[_Path]:
        """The path at its pace."""
        return self.descent.solution(self.descent.path(self.guess, self.start), "feasible")

    def tighten(self, solution: Solution[_Path], certificate: Certificate | None) -> bool:
        """Fly it slower."""
        self.guess = self.guess.time_scaled(SLOWER)
        return True


class _Exchange:
    """The program near a guess, with limits at samples, which counterexamples join as they are found."""

    def __init__(self, descent: _Descent, guess: WarmStart) -> None:
        segments = guess.trajectory.segments
        count = COARSE_SAMPLES if segments <= COARSE else FINE_SAMPLES
        self.guess = guess
        self._descent = descent
        self._samples = (np.linspace(0.0, 1.0, count),) * segments
        self._radius = TRUST_RADIUS / segments
        self._backoff = FIRST_BACKOFF + descent.config.reserve

    def solve(self) -> Solution[_Path]:
        """The fastest path within the trust region around the guess."""
        descent = self._descent
        program = KnotProgram(
            problem=descent.problem,
            vehicle=descent.vehicle,
            guess=self.guess,
            samples=self._samples,
            bounds=descent.bounds,
            radius=self._radius,
            reserve=self._backoff,
            still_ends=descent.config.still_ends,
        )
        found, answer = program.solve(descent.config.iterations)
        status = "locally optimal" if answer.converged else "unknown"
        path = descent.path(found, unsolved=answer.violation)
        return descent.solution(path, status, answer.iterations, answer.time)

    def go_on_from(self, certified: WarmStart) -> None:
        """Begin again from a certified path, in the whole trust region."""
        self.guess = certified
        self._radius = TRUST_RADIUS / certified.trajectory.segments

    def tighten(self, solution: Solution[_Path], certificate: Certificate | None) -> bool:
        """Sample where limits are exceeded, and go on from there, or in a smaller region if by too much.

        A path slower than the best that is certified is given up: tightening only slows it further.
        """
        best = self._descent.best
        if best is not None and solution.duration >= best.solution.duration:
            return False
        found, violation = solution.source.guess, solution.source.violation
        for finding in () if certificate is None else certificate.findings:
            if finding.verdict is not Verdict.HOLDS:
                violation = violation.add_counterexample(found.trajectory, finding.time, FIRST_BACKOFF)
        self._samples = violation.joined(self._samples)
        gain = 1.0 - found.trajectory.duration / self.guess.trajectory.duration
        little = gain < LITTLE_GAIN
        if little and 0.0 < violation.worst < MENDABLE:
            self._backoff += violation.worst / 2.0
        if violation.worst > TRUSTED or solution.source.unsolved > (SOLVED if little else MENDABLE):
            self._radius = max(self._radius / SHRINK, MIN_RADIUS)
        if violation.worst <= TRUSTED:
            self.guess = found
        return True
