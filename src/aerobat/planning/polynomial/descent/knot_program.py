"""Free knots as a nonlinear program: the fastest polynomials of degree 9 near a guess that rotors can follow.

Its variables are the derivatives of position at the knots, the segments' durations, and where in its segment
each stage holds, see KnotVariables. All stay in a box around the guess: limits hold at samples only, and a
solver that is free to leap finds motions that cheat between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf
from typing import Any

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization.nonlinear import NonlinearProgram, NonlinearResult, import_casadi, solve_nonlinear
from aerobat.planning.polynomial.descent.knot_variables import KnotVariables
from aerobat.planning.polynomial.descent.path_limits import (
    PathLimits,
    Samples,
)
from aerobat.planning.polynomial.descent.stage_constraints import StageConstraints
from aerobat.planning.warm_start import WarmStart

ROUGH = 1e-3  # tolerance of IPOPT, the cost being one: a path of a few segments comes within a percent
FINE = 1e-5  # likewise: many samples, each a little short of its limit, add up
BARRIER = 2e-4  # the first parameter: some hundred active limits times it are little beside the cost
OPTIONS = {
    # rows are scaled already: MUMPS needs not permute the system's to find pivots, a quarter of its time
    "mumps_permuting_scaling": 0,
    # slacks and multipliers fit the barrier from the start: half the iterations of slacks next to zero
    "slack_bound_push": 1e-2,
    "slack_bound_frac": 1e-2,
    "bound_mult_init_method": "mu-based",
}


@dataclass(frozen=True, eq=False)
class KnotProgram:
    """The program around a guess, whose segments it keeps; an answer is the next one's guess."""

    variables: KnotVariables
    limits: PathLimits
    samples: Samples  # at which limits hold
    stages: StageConstraints
    reserve: Array  # of every limit's range, kept at the samples of each segment, (S, size)

    def solve(self, iterations: int, tolerance: float) -> tuple[WarmStart, NonlinearResult]:
        """The solution near the guess, as the next guess. Raises BackendMissing without CasADi.

        Args:
            iterations: Of the solver, at most.
            tolerance: Of the solver.
        """
        answer = solve_nonlinear(
            self.program,
            self.variables.start,
            max_iterations=iterations,
            tolerance=tolerance,
            initial_barrier=BARRIER,
            options=OPTIONS,
        )
        return self.variables.read(answer.x), answer

    @cached_property
    def program(self) -> NonlinearProgram:
        """Its symbols, limits and exact derivatives."""
        ca, variables = import_casadi(), self.variables
        x = ca.MX.sym("x", variables.size)
        seldom, seldom_slopes, seldom_curvature, seldom_limits = self.stages.functions()
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
            rows.append(ca.vec(mapped(*self.limits.ends(matrix @ x + constant), weights, frames)))
        return ca.vertcat(*rows)

    def _jacobian(self, x: Any) -> Any:
        ca, rows = import_casadi(), []
        for matrix, constant, weights, frames, count in self._places:
            mapped = self.limits.jacobian.map("jacobian", "serial", count, [0, 1], [])
            _, turned = mapped(*self.limits.ends(matrix @ x + constant), weights, frames)
            rows.append(turned.T @ matrix)
        return ca.vertcat(*rows)

    def _hessian(self, x: Any, multipliers: Any) -> Any:
        ca, size = import_casadi(), self.limits.size
        parts, first = 0, 0
        for matrix, constant, weights, frames, count in self._places:
            mapped = self.limits.hessian.map("hessian", "serial", count, [0, 1], [0])
            own = ca.reshape(multipliers[first : first + size * count], size, count)
            first += size * count
            local = mapped(*self.limits.ends(matrix @ x + constant), weights, frames, own)
            parts += matrix.T @ local @ matrix
        return parts

    def _along_limits(self) -> tuple[Array, Array]:
        """Limits of all values at samples; linear bounds do not count at the very ends, which are fixed."""
        own = [
            np.tile(self.limits.limits(reserve), (1, len(s))).reshape(2, len(s), -1)
            for reserve, s in zip(self.reserve, self.samples, strict=True)
        ]
        lower, upper = np.concatenate(own, axis=1)
        linear = slice(self.limits.size - len(self.limits.of_path), None)
        lower[[0, -1], linear], upper[[0, -1], linear] = -inf, inf
        return lower.ravel(), upper.ravel()
