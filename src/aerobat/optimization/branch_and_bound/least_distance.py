"""The shortest vector within bounds, by DAQP's dual active-set method with warm start."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array, Indices
from aerobat.optimization.branch_and_bound.null_space import UNBOUNDED
from aerobat.optimization.deadline import count_work

# DAQP's flags of a row, and its exit flags
_AT_UPPER, _AT_LOWER, _IGNORED = 1, 3, 4
_SOLVED, _INFEASIBLE, _OVERDETERMINED = 1, -1, -6
_EQUAL = 1e-11  # bounds closer than this, relative to the larger one or to 1, make an equality
# residual, relative to the largest target, above which equalities contradict each other
_CONTRADICTION = 1e-7
_INDEPENDENT = 1e-8  # a unit row whose part orthogonal to other rows is shorter depends on them
_TOLERANCE = 1e-9  # constraint tolerance on rows of unit norm
_SETTINGS = {"primal_tol": _TOLERANCE}
# for QPs at which the usual settings fail
_CAREFUL_SETTINGS = {"pivot_tol": 1e-4, "sing_tol": 1e-13, "dual_tol": 1e-10}
_QP_WORK = 0.1e-3  # work of a QP [s], measured (benchmarks/work.py)
_ITERATION_WORK = 0.09e-9  # work of an iteration for each number in the rows [s], likewise


class NotConverged(Exception):
    """DAQP neither solved a problem nor proved it infeasible."""


@dataclass(frozen=True, eq=False, slots=True)
class QPSolution:
    """The minimizer of ½|y|² within bounds, and its active set."""

    y: Array
    value: float  # ½|y|²
    lower: Array  # the bounds for which the solution was computed
    upper: Array
    active: Indices  # the rows at their bounds
    multipliers: Array  # of the active rows: positive at an upper bound, negative at a lower


class LeastDistanceQP:
    """Minimize ½|y|² subject to lower <= M y <= upper, for fixed rows M of unit norm or zero."""

    def __init__(self, rows: Array) -> None:
        """Keep the rows."""
        self._rows = rows

    @cached_property
    def _model(self) -> Any:
        import daqp

        model = daqp.Model()
        unbounded = np.full(len(self._rows), UNBOUNDED)
        # The linear term is None, not zero: DAQP would multiply a zero one by all rows at every change of
        # bounds.
        model.setup(np.eye(self._rows.shape[1]), None, self._rows, unbounded, -unbounded)
        model.settings = _SETTINGS
        return model

    def solve(
        self, lower: Array, upper: Array, warm_start: QPSolution | None = None, cutoff: float = UNBOUNDED
    ) -> QPSolution | None:
        """Return the minimizer, or None where there is none with ½|y|² <= cutoff.

        Args:
            lower: lower bounds of M y, (m,), −UNBOUNDED where there is none.
            upper: upper bounds of M y, (m,), UNBOUNDED where there is none.
            warm_start: the solution for similar bounds, whose active rows are tried first.
            cutoff: largest ½|y|² of interest.

        Raises:
            NotConverged: DAQP fails even with its careful settings.
        """
        if lower.max(initial=0.0) <= 0.0 <= upper.min(initial=0.0):
            y = np.zeros(self._rows.shape[1])
            return QPSolution(y, 0.0, lower, upper, np.zeros(0, dtype=np.intp), np.zeros(0))
        unbounded = upper - lower >= 2.0 * UNBOUNDED
        cold = np.multiply(unbounded, _IGNORED, dtype=np.intc)
        warm = cold
        if warm_start is not None:
            warm = cold.copy()
            warm[warm_start.active] = np.where(warm_start.multipliers > 0.0, _AT_UPPER, _AT_LOWER)
        y, flag, multipliers = self._run(lower, upper, warm, cutoff)
        if flag not in (_SOLVED, _INFEASIBLE):
            y, flag, multipliers = self._run(lower, upper, cold, cutoff)
        if flag in (_INFEASIBLE, _OVERDETERMINED):  # dependent equalities may be the cause
            redundant = self._redundant(lower, upper)
            if redundant is None:
                return None
            if len(redundant):
                cold[redundant] = _IGNORED
                y, flag, multipliers = self._run(lower, upper, cold, cutoff)
        if flag not in (_SOLVED, _INFEASIBLE):
            usual_settings = self._model.settings
            self._model.settings = _CAREFUL_SETTINGS
            y, flag, multipliers = self._run(lower, upper, cold, cutoff)
            self._model.settings = usual_settings
        if flag not in (_SOLVED, _INFEASIBLE):
            raise NotConverged
        if flag == _INFEASIBLE:
            return None
        active = multipliers.nonzero()[0]
        return QPSolution(y, 0.5 * float(y @ y), lower, upper, active, multipliers[active])

    def _redundant(self, lower: Array, upper: Array) -> Indices | None:
        """Return the equalities that follow from others; None where no y satisfies all of them.

        DAQP ignores residuals below `_TOLERANCE` and detects dependence where they are larger. It reports
        dependent equalities with residuals near the tolerance as infeasible, for bounds of any size.
        """
        larger = np.maximum(np.abs(lower), np.abs(upper))
        equal = np.flatnonzero(upper - lower <= _EQUAL * np.maximum(larger, 1.0))
        rows, target = self._rows[equal], upper[equal]
        if not len(rows) or (
            len(rows) <= rows.shape[1] and np.linalg.svd(rows, compute_uv=False)[-1] > _INDEPENDENT
        ):
            return np.zeros(0, dtype=np.intp)
        residual = rows @ np.linalg.lstsq(rows, target, rcond=_INDEPENDENT)[0] - target
        if np.abs(residual).max() > max(_CONTRADICTION * np.abs(target).max(), _TOLERANCE):
            return None
        basis = np.zeros((0, rows.shape[1]))
        redundant = []
        for i, row in zip(equal.tolist(), rows, strict=True):
            rest = row - basis.T @ (basis @ row)
            rest = rest - basis.T @ (basis @ rest)
            norm = float(np.linalg.norm(rest))
            if norm > _INDEPENDENT:
                basis = np.vstack([basis, rest / norm])
            else:
                redundant.append(i)
        return np.array(redundant, dtype=np.intp)

    def _run(
        self, lower: Array, upper: Array, sense: NDArray[np.intc], cutoff: float
    ) -> tuple[Array, int, Array]:
        self._model.settings = {"fval_bound": cutoff}
        flag = self._model.update(bupper=upper, blower=lower, sense=sense)
        if flag < 0:  # infeasible at once: a lower bound exceeds its upper bound
            return lower, flag, lower
        y, _, flag, details = self._model.solve()
        count_work(_QP_WORK + _ITERATION_WORK * self._rows.size * details["iterations"])
        return y, flag, details["lam"]
