"""The shortest vector within bounds, by DAQP's dual active-set method, warm-started."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import daqp
import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.optimization.assignment import Indices
from aerobat.optimization.branch_and_bound.null_space import UNBOUNDED

# DAQP's marks on a row
_AT_UPPER, _AT_LOWER, _IGNORED = 1, 3, 4
_SOLVED, _EXCLUDED = 1, -1
_PRIMAL_TOLERANCE = 1e-9  # on rows of unit length
_CAREFUL = {"pivot_tol": 1e-4, "sing_tol": 1e-13, "dual_tol": 1e-10}  # tried when the ordinary settings fail


class NotConverged(Exception):
    """DAQP neither solved a problem nor proved it infeasible."""


@dataclass(frozen=True, eq=False, slots=True)
class Point:
    """The minimiser of ½|y|² within bounds, and what holds it there."""

    y: Array
    value: float  # ½|y|²
    lower: Array  # the bounds it was found for
    upper: Array
    active: Indices  # rows that hold it
    multipliers: Array  # of the active rows: positive at an upper bound, negative at a lower


class LeastDistance:
    """minimise ½|y|² subject to lower <= M y <= upper, for rows M of unit length or zero, many times over."""

    def __init__(self, rows: Array) -> None:
        """Keep the rows."""
        self._rows = rows

    @cached_property
    def _model(self) -> Any:
        model = daqp.Model()
        unbounded = np.full(len(self._rows), UNBOUNDED)
        # no linear term, not a zero one: DAQP would multiply it by all rows at every change of bounds
        model.setup(np.eye(self._rows.shape[1]), None, self._rows, unbounded, -unbounded)
        model.settings = {"primal_tol": _PRIMAL_TOLERANCE}
        return model

    def solve(
        self, lower: Array, upper: Array, guess: Point | None = None, limit: float = UNBOUNDED
    ) -> Point | None:
        """The minimiser, or None where there is none with ½|y|² <= limit.

        Infinite bounds are ±UNBOUNDED. `guess` is a point of similar bounds, whose active rows are tried
        first. Raises NotConverged.
        """
        if lower.max(initial=0.0) <= 0.0 <= upper.min(initial=0.0):
            nothing = np.zeros(0)
            return Point(
                np.zeros(self._rows.shape[1]), 0.0, lower, upper, np.zeros(0, dtype=np.intp), nothing
            )
        unbounded = upper - lower >= 2.0 * UNBOUNDED
        cold = np.multiply(unbounded, _IGNORED, dtype=np.intc)
        y, flag, multipliers = self._run(lower, upper, _warmed(cold, guess), limit)
        if flag not in (_SOLVED, _EXCLUDED):
            y, flag, multipliers = self._run(lower, upper, cold, limit)
        if flag not in (_SOLVED, _EXCLUDED):
            ordinary = self._model.settings
            self._model.settings = _CAREFUL
            y, flag, multipliers = self._run(lower, upper, cold, limit)
            self._model.settings = ordinary
        if flag not in (_SOLVED, _EXCLUDED):
            raise NotConverged
        if flag == _EXCLUDED:
            return None
        active = multipliers.nonzero()[0]
        return Point(y, 0.5 * float(y @ y), lower, upper, active, multipliers[active])

    def _run(
        self, lower: Array, upper: Array, sense: NDArray[np.intc], limit: float
    ) -> tuple[Array, int, Array]:
        self._model.settings = {"fval_bound": limit}
        flag = self._model.update(bupper=upper, blower=lower, sense=sense)
        if flag < 0:  # excluded at once: a lower bound is above its upper bound
            return lower, flag, lower
        y, _, flag, details = self._model.solve()
        return y, flag, details["lam"]


def _warmed(cold: NDArray[np.intc], guess: Point | None) -> NDArray[np.intc]:
    if guess is None:
        return cold
    sense = cold.copy()
    sense[guess.active] = np.where(guess.multipliers > 0.0, _AT_UPPER, _AT_LOWER)
    return sense
