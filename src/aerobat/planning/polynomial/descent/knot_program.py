"""Free knots as a nonlinear program: the fastest polynomials of degree 9 near a guess that rotors can follow.

Its variables are the derivatives of position at the knots, the segments' durations, and where in its segment
each stage holds, see KnotVariables. All stay in a box around the guess: limits hold at samples only, and a
solver that is free to leap finds motions that cheat between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import inf, perm
from typing import Any

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization.nonlinear import NonlinearProgram, NonlinearResult, import_casadi, solve_nonlinear
from aerobat.planning.polynomial.descent.knot_variables import KnotVariables
from aerobat.planning.polynomial.descent.path_limits import (
    ORDERS,
    POLYNOMIAL_DEGREE,
    TO_COEFFICIENTS,
    PathLimits,
    Samples,
    bound_scale,
    scaled,
)
from aerobat.planning.warm_start import WarmStart
from aerobat.problem.ball import Ball
from aerobat.problem.condition import ForceBalance, LinearBound

WARM_ITERATIONS = 40  # where multipliers are known, at most: what takes longer is not near
BALL_SHARE = 1.0 - 1e-5  # of a ball's squared radius: rounding has the rest
NORMAL = 1e-9  # what a direction has of a plane that it is normal to


@dataclass(frozen=True)
class Precision:
    """How closely a program is solved, whose cost is one."""

    tolerance: float  # of IPOPT
    barrier: float  # the first barrier parameter
    warm_barrier: float | None  # the same where multipliers are known; None: they are not used


ROUGH = Precision(1e-3, 1e-3, None)  # a path of a few segments comes within a percent
FINE = Precision(1e-5, 2e-4, 1e-6)  # many samples, each a little short of its limit, add up


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Of a solution: of the box, of limits at samples, of stages."""

    box: Array  # (n,)
    samples: Samples
    sampled: tuple[Array, ...]  # of each segment, (samples, limits)
    stages: Array

    @classmethod
    def of(cls, answer: NonlinearResult, samples: Samples, limits: int) -> Multipliers:
        """Of an answer to a program with so many limits at samples."""
        box, rows = answer.multipliers
        ends = np.cumsum([limits * len(s) for s in samples])
        *sampled, stages = np.split(rows, ends)
        return cls(box, samples, tuple(each.reshape(-1, limits) for each in sampled), stages)

    def at(self, samples: Samples) -> tuple[Array, Array]:
        """Of the box, and of a program's rows at these samples, among which are all of its own."""
        rows = []
        for own, wanted, known in zip(self.samples, samples, self.sampled, strict=True):
            each = np.zeros((len(wanted), known.shape[1]))
            each[np.searchsorted(wanted, own)] = known
            rows.append(each.ravel())
        return self.box, np.concatenate([*rows, self.stages])


@dataclass(frozen=True, eq=False)
class KnotProgram:
    """The program around a guess, whose segments it keeps; an answer is the next one's guess."""

    variables: KnotVariables
    limits: PathLimits
    samples: Samples  # at which limits hold
    balance: ForceBalance  # that the stages' conditions on thrust are about
    reserve: Array  # of every limit's range, kept at the samples of each segment, (S,)

    def solve(
        self, iterations: int, precision: Precision, multipliers: Multipliers | None = None
    ) -> tuple[WarmStart, NonlinearResult, Multipliers]:
        """The solution near the guess, as the next guess. Raises BackendMissing without CasADi.

        Args:
            iterations: Of the solver, at most.
            precision: Of the solver.
            multipliers: Of a program about this guess or near it, at some of these samples.
        """
        answer = None
        if multipliers is not None and precision.warm_barrier is not None:
            answer = self._solved(min(iterations, WARM_ITERATIONS), precision, multipliers)
        if answer is None or not answer.converged:
            answer = self._solved(iterations, precision)
        found = Multipliers.of(answer, self.samples, self.limits.size)
        return self.variables.read(answer.x), answer, found

    def _solved(
        self, iterations: int, precision: Precision, multipliers: Multipliers | None = None
    ) -> NonlinearResult:
        return solve_nonlinear(
            self.program,
            self.variables.start,
            max_iterations=iterations,
            tolerance=precision.tolerance,
            initial_barrier=precision.barrier if multipliers is None else precision.warm_barrier,
            multipliers=None if multipliers is None else multipliers.at(self.samples),
        )

    @cached_property
    def program(self) -> NonlinearProgram:
        """Its symbols, limits and exact derivatives."""
        ca, variables = import_casadi(), self.variables
        x = ca.MX.sym("x", variables.size)
        seldom, seldom_slopes, seldom_curvature, seldom_limits = self._seldom()
        lower, upper = self._along_limits()
        count = len(self.samples)
        cost = np.zeros(variables.size)
        cost[:count] = 1.0 / count
        multipliers = ca.MX.sym("multipliers", len(lower) + seldom.numel_out(0))
        none, weight = ca.MX.sym("p", 0, 1), ca.MX.sym("w")
        sampled, curved = multipliers[: len(lower)], multipliers[len(lower) :]
        second = self._hessian(x, sampled) + seldom_curvature(x, curved)
        slopes = ca.vertcat(self._jacobian(x), seldom_slopes(x))
        values = ca.vertcat(self._along(x), seldom(x))
        return NonlinearProgram(
            x,
            ca.dot(ca.DM(cost), x),
            values,
            np.concatenate([lower, seldom_limits[0]]),
            np.concatenate([upper, seldom_limits[1]]),
            *variables.box,
            derivatives={
                "jac_g": ca.Function("jac_g", [x, none], [values, slopes], ["x", "p"], ["g", "jac_g_x"]),
                "hess_lag": ca.Function(
                    "hess_lag",
                    [x, none, weight, multipliers],
                    [ca.triu(second)],
                    ["x", "p", "lam_f", "lam_g"],
                    ["triu_hess_gamma_x_x"],
                ),
            },
        )

    @cached_property
    def _places(self) -> list[tuple[Any, ...]]:
        """Of each segment, its unknowns as a function of x; its samples' weights, frames and number."""
        ca = import_casadi()
        trajectory = self.variables.guess.trajectory
        frames = self.limits.frames(trajectory, self.samples)
        return [
            (
                *map(ca.sparsify, map(ca.DM, self.variables.local(i))),
                ca.DM(self.limits.at(s)),
                ca.DM(frame),
                len(s),
            )
            for i, (s, frame) in enumerate(zip(self.samples, frames, strict=True))
        ]

    def _along(self, x: Any) -> Any:
        """All values at samples, a column."""
        ca, rows = import_casadi(), []
        for matrix, constant, weights, frames, count in self._places:
            mapped = self.limits.values.map("values", "serial", count, [0, 1], [])
            rows.append(ca.vec(mapped(*self._ends(matrix, constant, x), weights, frames)))
        return ca.vertcat(*rows)

    def _jacobian(self, x: Any) -> Any:
        ca, rows = import_casadi(), []
        for matrix, constant, weights, frames, count in self._places:
            mapped = self.limits.jacobian.map("jacobian", "serial", count, [0, 1], [])
            _, turned = mapped(*self._ends(matrix, constant, x), weights, frames)
            rows.append(turned.T @ matrix)
        return ca.vertcat(*rows)

    def _hessian(self, x: Any, multipliers: Any) -> Any:
        ca, size = import_casadi(), self.limits.size
        parts, first = 0, 0
        for matrix, constant, weights, frames, count in self._places:
            mapped = self.limits.hessian.map("hessian", "serial", count, [0, 1], [0])
            own = ca.reshape(multipliers[first : first + size * count], size, count)
            first += size * count
            local = mapped(*self._ends(matrix, constant, x), weights, frames, own)
            parts += matrix.T @ local @ matrix
        return parts

    def _ends(self, matrix: Any, constant: Any, x: Any) -> tuple[Any, Any]:
        """E and T of a segment."""
        ca, local = import_casadi(), matrix @ x + constant
        return ca.reshape(local[:-1], self.limits.dimensions, len(ORDERS)).T, local[-1]

    def _along_limits(self) -> tuple[Array, Array]:
        """Limits of all values at samples; linear bounds do not count at the very ends, which are fixed."""
        own = [
            np.tile(self.limits.limits(reserve), (1, len(s))).reshape(2, len(s), -1)
            for reserve, s in zip(self.reserve.tolist(), self.samples, strict=True)
        ]
        lower, upper = np.concatenate(own, axis=1)
        linear = slice(self.limits.size - len(self.limits.bounds), None)
        lower[[0, -1], linear], upper[[0, -1], linear] = -inf, inf
        return lower.ravel(), upper.ravel()

    def _seldom(self) -> tuple[Any, Any, Any, tuple[Array, Array]]:
        """Values of the stages as a function of x, their Jacobian, their product's Hessian, their limits."""
        ca = import_casadi()
        x = ca.SX.sym("x", self.variables.size)
        rows = self._rows(x)
        values = ca.vertcat(*(value for value, _, _ in rows), ca.SX(0, 1))
        weights = ca.SX.sym("multipliers", values.numel())
        limits = np.array([(lower, upper) for _, lower, upper in rows]).reshape(-1, 2)
        return (
            ca.Function("values", [x], [values]),
            ca.Function("jacobian", [x], [ca.jacobian(values, x)]),
            ca.Function("hessian", [x, weights], [ca.hessian(ca.dot(values, weights), x)[0]]),
            (limits[:, 0], limits[:, 1]),
        )

    def _rows(self, x: Any) -> list[tuple[Any, float, float]]:
        """Constraints of the stages, each at its place, and of their order and windows."""
        ca, variables = import_casadi(), self.variables
        columns, rows = variables.place_columns, []
        starts = ca.cumsum(ca.vertcat(0, x[: len(self.samples)]))
        for j, stage in enumerate(variables.guess.stages):
            segment, s = variables.segments[j], x[columns[j]]
            matrix, constant = variables.local(segment)
            ends, duration = self._ends(ca.sparsify(ca.DM(matrix)), ca.DM(constant), x)
            coefficients = ca.DM(TO_COEFFICIENTS) @ (duration ** ca.DM(ORDERS.astype(float)) * ends)
            for condition in stage.conditions:
                rows += self._held(condition.bound(self.balance), coefficients, duration, s)
            if stage.ball is not None:
                rows.append(self._met(stage.ball, coefficients, s))
            earliest, latest = stage.window
            time = starts[segment] + x[segment] * s
            if earliest > 0.0:
                rows.append((time / starts[-1], earliest, latest))
            elif latest < 1.0:
                rows.append((time / starts[-1], -inf, latest))
        for j, (segment, following) in enumerate(pairwise(variables.segments)):
            if segment == following:
                rows.append((x[columns[j + 1]] - x[columns[j]], 0.0, inf))
        return rows

    def _met(self, ball: Ball, coefficients: Any, s: Any) -> tuple[Any, float, float]:
        """The squared distance from a ball's centre at a place in a segment, over its radius squared."""
        ca, axes = import_casadi(), self.limits.rotors.axes
        powers = ca.horzcat(*(s**p for p in range(POLYNOMIAL_DEGREE + 1)))
        offset = ca.DM(self.limits.origin - ball.centre) + ca.DM(axes) @ (powers @ coefficients).T
        return ca.sumsqr(offset) / ball.radius**2, -inf, BALL_SHARE

    def _held(
        self, bound: LinearBound, coefficients: Any, duration: Any, s: Any
    ) -> list[tuple[Any, float, float]]:
        """A bound at a place in a segment; nothing where no variable matters."""
        ca, axes = import_casadi(), self.limits.rotors.axes
        value = float(bound.weights[0] @ self.limits.origin)
        matters = False
        for k in bound.derivatives:
            along = bound.weights[k] @ axes
            if np.abs(along).max() < NORMAL:
                continue
            matters = True
            at = ca.horzcat(*(perm(p, k) * s ** max(p - k, 0) for p in range(POLYNOMIAL_DEGREE + 1)))
            value += at @ coefficients @ ca.DM(along) / duration**k
        if not matters:
            return []
        return [(value / bound_scale(bound), *scaled(bound))]
