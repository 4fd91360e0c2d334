"""The problem in the frame of motion of one start, and paths in it with the limits that they exceed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerobat.errors import Reason
from aerobat.flatness import force_balance
from aerobat.limits import limits_along
from aerobat.limits.body_in_gate import BodyInGate
from aerobat.limits.path_condition import limit_of
from aerobat.planning.certified_solve import Solution
from aerobat.planning.polynomial.descent.knot_samples import ConstraintViolation
from aerobat.planning.polynomial.descent.knot_variables import Frame
from aerobat.planning.polynomial.descent.path_limits import PathLimits
from aerobat.planning.polynomial.descent.symbolic_measures import SymbolicMeasures
from aerobat.planning.result import Plan
from aerobat.planning.warm_start import WarmStart
from aerobat.problem.condition import ForceBalance
from aerobat.problem.problem import Problem
from aerobat.problem.stage import StageSequence
from aerobat.vehicle import Vehicle

TRUSTED = 0.5  # of a limit's range: an excess between samples beyond it means that the solver has cheated
RELATIVE_STAGE_TOLERANCE = 1e-5  # of a condition's size: by how much a stage may be missed through rounding
SLOWER = 1.2  # times the duration, each time that a start is slowed
SLOWED = 15  # times, at most


@dataclass(frozen=True, eq=False)
class Path:
    """A path with its stages, where it comes from, and what limits it exceeds at a dense look."""

    guess: WarmStart
    violation: ConstraintViolation
    start: Plan | None = None  # whose path it is, if it is another planner's
    unsolved: float = 0.0  # of a limit's range, left by the solver at samples


@dataclass(frozen=True, eq=False)
class FramedProblem:
    """What all solves from one start share: the problem in the frame of motion of that start."""

    problem: Problem
    vehicle: Vehicle
    frame: Frame
    limits: PathLimits
    balance: ForceBalance
    reserve: float  # of the range of each of the vehicle's limits, proven of rotors
    in_gates: tuple[BodyInGate, ...] = ()  # those that the stages of the start cross

    @classmethod
    def of(
        cls,
        problem: Problem,
        vehicle: Vehicle,
        sequence: StageSequence,
        guess: WarmStart,
        reserve: float,
        in_gates: tuple[BodyInGate, ...] = (),
    ) -> FramedProblem:
        """Of a guess, in whose vertical plane all stays if it has one.

        Args:
            problem: What is planned.
            vehicle: What flies it.
            sequence: The problem's stages for it.
            guess: Where to begin.
            reserve: Of the range of each of the vehicle's limits, kept from either of its ends.
            in_gates: The body's room in gates that the guess's stages cross.
        """
        environment = problem.environment
        frame = Frame.around(guess, environment.wind, vehicle)
        balance = force_balance(environment, vehicle)
        measures = SymbolicMeasures(vehicle, frame.axes, environment, problem.heading)
        along = limits_along(vehicle, environment, problem.path_limits, sequence.path_constraints)
        limits = PathLimits.of(measures, frame.origin, along)
        return cls(problem, vehicle, frame, limits, balance, reserve, in_gates)

    def path(self, guess: WarmStart, start: Plan | None = None) -> Path:
        """A guess, looked at densely."""
        return Path(guess, ConstraintViolation.of(guess.trajectory, self.limits, self.reserve), start)

    def solution(self, path: Path, status: str, nodes: int = 0, solve_time: float = 0.0) -> Solution[Path]:
        """A path as a solution; a failure where it misses a stage, or exceeds limits."""
        trajectory = path.guess.trajectory
        failure = self._missed_stage(path.guess)
        if failure is None and path.violation.worst > 0.0:
            reason = path.violation.reason
            failure = Reason(f"{reason}{path.guess.leg_at(path.violation.time)}", reason.limits)
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

    def _missed_stage(self, guess: WarmStart) -> Reason | None:
        """The first stage that a guess misses, in a sentence; or None."""
        for stage, time in zip(guess.stages, guess.times, strict=True):
            where = (f"stage '{stage.name}'",)
            flat = np.array([guess.trajectory.evaluate(time, k) for k in range(3)])
            for condition in stage.conditions:
                excess = float(condition.bound(self.balance).excess(flat))
                if excess > RELATIVE_STAGE_TOLERANCE * limit_of(condition, self.balance).size:
                    return Reason(f"the stage '{stage.name}' is missed by {excess:.2g} in SI units", where)
            ball = stage.ball
            if ball is not None and (distance := float(np.linalg.norm(flat[0] - ball.centre))) > ball.radius:
                return Reason(f"the stage '{stage.name}' is missed by {distance - ball.radius:.2g} m", where)
            fraction, (earliest, latest) = time / guess.trajectory.duration, stage.window
            if max(earliest - fraction, fraction - latest) > RELATIVE_STAGE_TOLERANCE:
                return Reason(
                    f"the stage '{stage.name}' is passed at {fraction:.3g} of the duration, not when asked",
                    where,
                )
        return None
