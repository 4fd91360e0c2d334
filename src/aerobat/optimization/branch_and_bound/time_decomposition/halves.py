"""One half of a program that is cut in two, for any price of the state at the cut."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization.assignment import AssignmentProgram, row_norms, unit_rows
from aerobat.optimization.branch_and_bound.direct_search import Assignments, DirectSearch
from aerobat.optimization.branch_and_bound.search import SearchLimits

ACTIVE_TOLERANCE = 1e-7  # of a row's norm times that of x: rows as near to a bound hold it
CANCELLATION = 1e-13  # of |shift|², by which |v|² less |shift|² may be wrong
RANK_TOLERANCE = 1e-9  # singular values of unit rows below are zero


@dataclass(frozen=True, eq=False)
class HalfMinimum:
    """The best solution of a half at a price."""

    cost: float
    state: Array  # z, (r,)
    slots: tuple[int, ...]  # its stages'
    compliance: Array  # −sign dz/dq, (r, r): how the state gives way to the price, the same rows active


@dataclass(frozen=True, eq=False)
class HalfAnswer:
    """The answer for a half at a price: its bound and, where a solution was found, the best one."""

    bound: float  # no solution costs less
    nodes: int
    minimum: HalfMinimum | None = None


class Half:
    """Minimize |w|² + sign qᵀz, where z = Z w; with v = w + ½ sign Zᵀq that is the shortest v."""

    def __init__(self, program: AssignmentProgram, state: Array, sign: float) -> None:
        """Keep the program at the price zero, which minimizes |w|².

        Args:
            program: It.
            state: Z, (r, n).
            sign: Of the price q: 1 before the cut, −1 behind it.
        """
        self._program = program
        self._state = state
        self._sign = sign
        self._search = DirectSearch()

    def minimum(self, price: Array, limits: SearchLimits, cutoff: float = inf) -> HalfAnswer:
        """Search at a price q (r,) for what costs least, and less than `cutoff`."""
        shift = self._shift(price)
        program = self._shifted(shift)
        answer = self._search.claim(program, limits, cutoff=cutoff)
        bound = answer.bound - _rounding(shift)
        if answer.x is None or answer.slots is None:
            return HalfAnswer(bound, answer.nodes)
        minimum = HalfMinimum(
            cost=program.cost(answer.x),
            state=self._state @ (answer.x - shift),
            slots=answer.slots,
            compliance=self._compliance(program, answer.x, answer.slots),
        )
        return HalfAnswer(bound, answer.nodes, minimum)

    def below(self, price: Array, limits: SearchLimits, cutoff: float) -> Assignments:
        """All assignments that cost less than `cutoff` at a price, as `DirectSearch.below`."""
        shift = self._shift(price)
        return self._search.below(self._shifted(shift), limits, cutoff + _rounding(shift))

    def _compliance(self, program: AssignmentProgram, x: Array, slots: Sequence[int]) -> Array:
        """½ Z P Zᵀ, P the projector on what leaves the rows alone that hold a solution."""
        lower, upper = program.bounds_for(slots)
        values = program.rows @ x
        room = np.minimum(values - lower, upper - values)
        active = room <= ACTIVE_TOLERANCE * row_norms(program.rows) * np.linalg.norm(x)
        _, held = unit_rows(np.concatenate([program.rows[active], program.equality]))
        _, singular, directions = np.linalg.svd(held, full_matrices=False)
        directions = directions[singular > RANK_TOLERANCE]
        free = self._state - (self._state @ directions.T) @ directions
        return np.asarray(0.5 * free @ free.T)

    def _shift(self, price: Array) -> Array:
        return np.asarray(0.5 * self._sign * (price @ self._state))

    def _shifted(self, shift: Array) -> AssignmentProgram:
        """The program of v = w + shift."""
        base = self._program
        moved = base.rows @ shift
        stages = [
            replace(stage, lower=stage.lower + moved[stage.rows], upper=stage.upper + moved[stage.rows])
            for stage in base.stages
        ]
        return replace(
            base,
            target=base.target + base.equality @ shift,
            lower=base.lower + moved,
            upper=base.upper + moved,
            stages=tuple(stages),
            constant=-float(shift @ shift),
        )


def _rounding(shift: Array) -> float:
    return CANCELLATION * float(shift @ shift)
