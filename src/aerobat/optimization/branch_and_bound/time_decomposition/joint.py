"""The optimum of a whole program with every stage in a slot, and its multipliers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization.assignment import AssignmentProgram, unit_rows
from aerobat.optimization.branch_and_bound.least_distance import LeastDistanceQP
from aerobat.optimization.branch_and_bound.null_space import UNBOUNDED, in_units


@dataclass(frozen=True, eq=False)
class Joint:
    """The shortest x with every stage in a slot."""

    slots: tuple[int, ...]  # the stages'
    x: Array  # (n,)
    cost: float  # |x|²
    multipliers: Array  # of the rows and then the equalities, (m + p,): 2 x + rowsᵀ multipliers = 0


class JointQP:
    """One program's QP, for many assignments."""

    def __init__(self, program: AssignmentProgram, unit: float) -> None:
        """Keep its rows; `unit` is about as large as |x|."""
        self._program = program
        self._unit = unit
        rows = np.concatenate([program.rows, program.equality])
        self._norms, rows = unit_rows(rows)
        self._qp = LeastDistanceQP(rows)

    def solve(self, slots: Sequence[int], cutoff: float) -> Joint | None:
        """Return the optimum; None where there is none that costs less than `cutoff`. Raises NotConverged."""
        target = self._program.target
        lower, upper = (
            in_units(np.concatenate([bound, target]) / self._norms, self._unit)
            for bound in self._program.bounds_for(slots)
        )
        solution = self._qp.solve(lower, upper, cutoff=min(0.5 * cutoff / self._unit**2, UNBOUNDED))
        if solution is None:
            return None
        x = self._unit * solution.y
        multipliers = np.zeros(len(self._norms))
        multipliers[solution.active] = solution.multipliers
        return Joint(tuple(slots), x, float(x @ x), 2.0 * self._unit * multipliers / self._norms)
