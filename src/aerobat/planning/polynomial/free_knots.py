"""Polynomials whose knots are free: nearly time-optimal, certified, from the paper's search or its MIQP.

Degree 9 as in Section V-B, but derivatives at the knots and durations are chosen by the rotors' limits, not
by a cost that knows nothing of them: that is where the closed form loses most of its time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from aerobat.certification import Certificate, Verdict
from aerobat.errors import Infeasible, SpecError
from aerobat.flatness import end_thrust
from aerobat.optimization.nonlinear import NonlinearResult, import_casadi
from aerobat.planning.miqp import Miqp
from aerobat.planning.polynomial.knot_bounds import Bound, path_bounds
from aerobat.planning.polynomial.knot_program import KnotProgram
from aerobat.planning.polynomial.knot_rounds import COARSE, RESERVE, Round
from aerobat.planning.polynomial.knot_samples import ConstraintViolation, refit
from aerobat.planning.polynomial.min_snap import MinSnap
from aerobat.planning.proof import certificate_for
from aerobat.planning.result import Attempt, PlacedStage, Plan
from aerobat.planning.warm_start import WarmStart
from aerobat.problem.problem import Problem
from aerobat.problem.stage import StageSequence
from aerobat.vehicle import Vehicle

ROUNDS = 36  # of solving, at most, for one number of segments
MISSED = 1e-5  # of a condition's size: by how much a stage may be missed through rounding
SLOWER = 1.2  # times the duration, each time that a start is slowed
SLOWED = 15  # times, at most
MENDING = 8  # of the rounds, the last, which only mend what is exceeded
FREE_FALL = 1e-3  # of gravity: a specific thrust that gives an end no attitude

Progress = Callable[[Attempt], None]


@dataclass(frozen=True)
class FreeKnots:
    """How to plan: so many `segments` in all; two are quick, eight nearly time-optimal.

    It begins from `start`, a plan of the same problem, certified or not; without one from the closed form
    through waypoints, or else from the MIQP's plan. Stages hold anywhere in their order; two segments have
    room for a flip's five. At the ends the body does not turn, but its thrust may be changing, so that there
    is jerk along it, unless `still_ends` asks for none. A `reserve`, a part of every limit's range, is kept
    at samples from either end, for the controller: eight segments without one leave it none.
    """

    segments: int = 2
    start: Plan | None = None
    still_ends: bool = False
    reserve: float = 0.0
    iterations: int = 50  # at most, each solve

    def __post_init__(self) -> None:
        """Check."""
        if self.segments < COARSE:
            raise SpecError(f"segments must be {COARSE} or more, got {self.segments}")
        if not 0.0 <= self.reserve < 0.5:
            raise SpecError(f"reserve must be a part of the range of thrust, 0 to 0.5, got {self.reserve}")
        if self.iterations < 1:
            raise SpecError(f"iterations must be 1 or more, got {self.iterations}")

    def plan(
        self, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        """The fastest certified plan found; the plan that it began from, where none is faster.

        Raises SpecError without a vehicle and for input that makes no sense, Infeasible when nothing is
        certified, BackendMissing without CasADi.
        """
        if vehicle is None:
            raise SpecError(
                "the free-knots planner needs a vehicle: no limits, no least time; give --vehicle"
            )
        _check(problem, vehicle)
        import_casadi()
        run = _Run.of(self, problem, vehicle, progress)
        for start in run.starts():
            run.descend(start)
            if run.best is not None:
                return run.plan(run.best)
        raise Infeasible(
            f"no polynomials are certified to fly '{problem.name}' with {vehicle.name}: at the last attempt "
            f"{run.attempts[-1].outcome}; give more segments, or ask less of stages and limits",
            run.attempts,
        )


@dataclass(frozen=True, eq=False)
class _Found:
    """A guess that is certified."""

    guess: WarmStart
    excess: ConstraintViolation
    certificate: Certificate
    start: Plan | None  # whose path it is, slowed down or not, if it is another planner's


@dataclass(frozen=True, eq=False)
class _Judged:
    """What a guess comes to."""

    excess: ConstraintViolation
    certified: bool
    outcome: str  # a sentence


@dataclass
class _Run:
    """One run of the planner: keeps the record, and the best that is certified."""

    config: FreeKnots
    problem: Problem
    vehicle: Vehicle
    sequence: StageSequence
    gravity: float  # [m/s²] as the stages mean it
    bounds: tuple[Bound, ...]
    progress: Progress | None
    attempts: list[Attempt] = field(default_factory=list)
    best: _Found | None = None

    @classmethod
    def of(cls, config: FreeKnots, problem: Problem, vehicle: Vehicle, progress: Progress | None) -> _Run:
        gravity = problem.environment.gravity
        sequence = problem.stages(vehicle.max_specific_thrust)
        bounds = path_bounds(problem, sequence, gravity)
        return cls(config, problem, vehicle, sequence, gravity, bounds, progress)

    def starts(self) -> Iterator[Plan]:
        """Plans to begin from, the best first; the last knows no rotors."""
        if self.config.start is not None:
            yield self.config.start
        if self.problem.maneuver.through_points:
            yield from self._planned(MinSnap(), self.vehicle)
        yield from self._planned(Miqp(), self.vehicle)
        yield Miqp().plan(self.problem)

    def descend(self, start: Plan) -> None:
        """Free the knots of a plan: first of few segments, then of as many as are wanted."""
        guess = WarmStart.of(start, self.sequence)
        if not self._judged(guess, start).certified:
            guess = self._slowed(guess, start)
        for segments in sorted({COARSE, self.config.segments}):
            shaped = replace(guess, trajectory=refit(guess.trajectory, segments))
            last = self._rounds(Round.first(shaped, self._excess(shaped), self.config.reserve))
            if last.usable:
                guess = last.guess

    def plan(self, found: _Found) -> Plan:
        """The plan of what is certified; its start's path, where that is the best."""
        guess, start = found.guess, found.start
        segments = np.searchsorted(guess.trajectory.knots[1:-1], guess.times, side="right").tolist()
        stages = (
            PlacedStage(stage.name, segment, time, stage.gate)
            for stage, segment, time in zip(guess.stages, segments, guess.times, strict=True)
        )
        return Plan(
            problem=self.problem,
            trajectory=guess.trajectory,
            planner="free-knots",
            order=5 if start is None else start.order,
            cost=guess.trajectory.duration,
            status="locally optimal" if start is None else "feasible",
            backend="ipopt" if start is None else start.backend,
            stages=tuple(stages),
            attempts=tuple(self.attempts),
            vehicle=self.vehicle,
            margin=found.excess.margin,
            certificate=found.certificate,
        )

    def _rounds(self, now: Round) -> Round:
        """Solve in one box after the other until little is gained and the last is certified."""
        for i in range(ROUNDS):
            now.repairing |= i >= ROUNDS - MENDING
            found, answer = self._program(now).solve(self.config.iterations)
            judged = self._judged(found)
            self._record(found, answer, judged)
            taken = now.takes(found, judged.excess, answer.violation)
            if (taken and now.repairing and judged.certified) or now.spent:
                break
        return now

    def _program(self, now: Round) -> KnotProgram:
        return KnotProgram(
            problem=self.problem,
            vehicle=self.vehicle,
            guess=now.guess,
            samples=now.samples,
            bounds=self.bounds,
            gravity=self.gravity,
            radius=now.box,
            reserve=now.reserve,
            still_ends=self.config.still_ends,
        )

    def _excess(self, guess: WarmStart) -> ConstraintViolation:
        return ConstraintViolation.of(guess.trajectory, self.vehicle, self.problem.environment, self.bounds)

    def _judged(self, guess: WarmStart, start: Plan | None = None) -> _Judged:
        """What a guess comes to; the best that is certified is kept."""
        excess, missed = self._excess(guess), self._missed(guess)
        if missed is not None or not excess.margin.feasible:
            return _Judged(excess, False, missed or str(excess.margin))
        certificate = certificate_for(guess.trajectory, self.problem, self.vehicle)
        if not certificate.certified:
            return _Judged(self._refuted(guess, excess, certificate), False, certificate.why)
        if self.best is None or guess.trajectory.duration < self.best.guess.trajectory.duration:
            self.best = _Found(guess, excess, certificate, start)
        return _Judged(excess, True, certificate.why)

    def _refuted(
        self, guess: WarmStart, excess: ConstraintViolation, certificate: Certificate
    ) -> ConstraintViolation:
        """The excess, with what samples have overlooked and the certificate has not."""
        span = float((self.vehicle.max_thrusts - self.vehicle.min_thrusts).min())
        for finding in certificate.findings:
            if finding.verdict is not Verdict.HOLDS:
                rotor = finding.quantity.startswith("rotor ")
                part = -(finding.margin or 0.0) / span if rotor else 0.0
                excess = excess.beside(guess.trajectory, finding.time, max(part, RESERVE))
        return excess

    def _missed(self, guess: WarmStart) -> str | None:
        """The first stage that a guess misses, in a sentence; or None."""
        for stage, time in zip(guess.stages, guess.times, strict=True):
            for bound in (Bound.of(condition, self.gravity) for condition in stage.conditions):
                excess = bound.excess_at(guess.trajectory, time)
                if excess > MISSED * bound.scale:
                    return f"the stage '{stage.name}' is missed by {excess:.2g} in SI units"
        return None

    def _slowed(self, guess: WarmStart, start: Plan) -> WarmStart:
        """A guess at the first slower pace that is certified; as it is, where none is."""
        for times in range(1, SLOWED + 1):
            slower = guess.time_scaled(SLOWER**times)
            if self._judged(slower, start).certified:
                return slower
        return guess

    def _record(self, guess: WarmStart, answer: NonlinearResult, judged: _Judged) -> None:
        duration, status = guess.trajectory.duration, "locally optimal" if answer.converged else "unknown"
        attempt = Attempt(
            duration, judged.certified, status, judged.outcome, duration, answer.iterations, answer.time
        )
        self.attempts.append(attempt)
        if self.progress is not None:
            self.progress(attempt)

    def _planned(self, planner: MinSnap | Miqp, vehicle: Vehicle) -> Iterator[Plan]:
        """The plan of another planner, if it finds one."""
        try:
            yield planner.plan(self.problem, vehicle)
        except Infeasible as infeasible:
            if not infeasible.attempts:  # a stage asks more thrust than there is
                raise


def _check(problem: Problem, vehicle: Vehicle) -> None:
    """Refuse ends without an attitude."""
    for name, state in (("start", problem.start), ("goal", problem.goal)):
        thrust = end_thrust(state.velocity, state.acceleration, vehicle, problem.environment)
        if np.linalg.norm(thrust) < FREE_FALL * problem.environment.gravity:
            raise SpecError(
                f"{name}.acceleration asks no thrust, which leaves the attitude there open; change it"
            )
