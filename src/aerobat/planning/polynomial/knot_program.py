"""Free knots as a nonlinear program: the fastest polynomials of degree 9 near a guess that rotors can follow.

Its variables are the derivatives of position at the knots (position to jerk shared by both neighbours, so
that body rates are continuous; snap one for each side), snap at both ends, where jerk is zero, the segments'
durations, and where in its segment each stage holds. All stay in a box around the guess: limits hold at
samples only, and a solver that is free to leap finds motions that cheat between them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import inf, perm
from typing import Any

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization.nonlinear import NonlinearProgram, NonlinearResult, import_casadi, solve_nonlinear
from aerobat.planning.polynomial.knot_bounds import Bound
from aerobat.planning.polynomial.knot_variables import (
    END_ORDER,
    POLYNOMIAL_DEGREE,
    Frame,
    KnotVariables,
)
from aerobat.planning.polynomial.rotor_constraints import RotorConstraints
from aerobat.planning.warm_start import WarmStart
from aerobat.problem.problem import Problem
from aerobat.vehicle import Vehicle

FLOOR = 0.02
TOLERANCE = 1e-5  # of IPOPT
WARM = 1e-3  # the first barrier parameter
NORMAL = 1e-9  # what a direction has of a plane that it is normal to


@dataclass(frozen=True, eq=False)
class _Rows:
    """lower ≤ value ≤ upper, columns."""

    value: Any
    lower: Array
    upper: Array


@dataclass(frozen=True, eq=False)
class KnotProgram:
    """The program around a guess, whose segments it keeps; an answer is the next one's guess."""

    problem: Problem
    vehicle: Vehicle
    guess: WarmStart
    samples: tuple[Array, ...]  # normalised times in each segment at which limits hold
    bounds: tuple[Bound, ...]  # that hold along the whole path
    radius: float  # of the trust region, a box in scaled variables
    reserve: float  # of every limit's range, kept at samples
    still_ends: bool = False  # see KnotVariables

    def solve(self, iterations: int) -> tuple[WarmStart, NonlinearResult]:
        """The solution near the guess, as the next guess. Raises BackendMissing without CasADi."""
        start = self._variables.start
        answer = solve_nonlinear(
            self._program, start, max_iterations=iterations, tolerance=TOLERANCE, initial_barrier=WARM
        )
        return self._variables.read(answer.x), answer

    @cached_property
    def _variables(self) -> KnotVariables:
        trajectory = self.guess.trajectory
        segments = np.searchsorted(trajectory.knots[1:-1], self.guess.times, side="right")
        return KnotVariables(
            self.problem,
            self.vehicle,
            self.guess,
            tuple(segments.tolist()),
            Frame.around(self.guess, self.problem.environment.wind),
            self.radius,
            self.still_ends,
        )

    @cached_property
    def _program(self) -> NonlinearProgram:
        ca, variables = import_casadi(), self._variables
        rows = [self._rotors(), *self._path(), *self._stages(), *self._order()]
        durations = [variables.duration(i) for i in range(len(self.samples))]
        return NonlinearProgram(
            variables.x,
            sum(durations) / self.guess.trajectory.duration,
            ca.vertcat(*(row.value for row in rows)),
            np.concatenate([row.lower for row in rows]),
            np.concatenate([row.upper for row in rows]),
            *variables.box,
        )

    def _rotors(self) -> _Rows:
        """Limits of rotors and the floor of thrust at all samples."""
        ca, trajectory, variables = import_casadi(), self.guess.trajectory, self._variables
        rotors = RotorConstraints(
            self.vehicle, variables.frame.axes, self.problem.environment, self.problem.heading
        )
        moving = [
            ca.vertcat(*((ca.DM(_powers(s, k)) @ variables.coefficients[i]).T for k in range(1, END_ORDER)))
            for i, s in enumerate(self.samples)
        ]
        durations = [ca.repmat(variables.duration(i), 1, len(s)) for i, s in enumerate(self.samples)]
        segments = zip(trajectory.knots[:-1], trajectory.durations, self.samples, strict=True)
        times = np.concatenate([start + duration * s for start, duration, s in segments])
        frames = ca.DM(rotors.frames(trajectory, np.minimum(times, trajectory.duration)))
        values = rotors.function.map(len(times))(ca.horzcat(*moving), ca.horzcat(*durations), frames)
        lower, upper = np.full(rotors.size, self.reserve), np.full(rotors.size, 1.0 - self.reserve)
        lower[-1], upper[-1] = FLOOR**2, inf
        return _Rows(ca.vec(values), np.tile(lower, len(times)), np.tile(upper, len(times)))

    def _path(self) -> Iterator[_Rows]:
        """Constraints along the whole path, at all samples but the very ends, which are fixed."""
        last = len(self.samples) - 1
        for bound in self.bounds:
            for i, s in enumerate(self.samples):
                inner = s[((s > 0.0) | (i > 0)) & ((s < 1.0) | (i < last))]
                yield from self._within(bound, i, _powers(inner, bound.derivative), self.reserve)

    def _stages(self) -> Iterator[_Rows]:
        """Constraints of the stages, each at its place."""
        ca, variables = import_casadi(), self._variables
        for j, stage in enumerate(self.guess.stages):
            s = variables.place(j)
            for bound in (
                Bound.of(condition, self.problem.environment.gravity) for condition in stage.conditions
            ):
                k = bound.derivative
                at = ca.horzcat(*(perm(p, k) * s ** max(p - k, 0) for p in range(POLYNOMIAL_DEGREE + 1)))
                yield from self._within(bound, variables.segments[j], at, 0.0)

    def _within(self, bound: Bound, segment: int, at: Any, reserve: float) -> Iterator[_Rows]:
        """Rows that keep a bound with a reserve at powers `at` (n, 10); none where no variable matters."""
        ca, variables = import_casadi(), self._variables
        along = bound.direction @ variables.frame.axes
        if np.abs(along).max() < NORMAL:
            return
        coefficients = variables.coefficients[segment] @ ca.DM(along)
        value = ca.mtimes(at, coefficients) / variables.duration(segment) ** bound.derivative
        offset = float(bound.direction @ variables.frame.origin) if bound.derivative == 0 else 0.0
        count = int(value.numel())
        lower, upper = (bound.lower - offset) / bound.scale, (bound.upper - offset) / bound.scale
        yield _Rows(value / bound.scale, np.full(count, lower + reserve), np.full(count, upper - reserve))

    def _order(self) -> Iterator[_Rows]:
        """Stages in one segment keep their order."""
        variables = self._variables
        for j, (segment, following) in enumerate(pairwise(variables.segments)):
            if segment == following:
                yield _Rows(variables.place(j + 1) - variables.place(j), np.zeros(1), np.full(1, inf))


def _powers(s: Array, derivative: int) -> Array:
    """The k-th derivatives of 1, s, ..., s⁹ at normalised times s (n,), (n, 10)."""
    columns = [perm(p, derivative) * s ** max(p - derivative, 0) for p in range(POLYNOMIAL_DEGREE + 1)]
    return np.stack(columns, axis=-1)
