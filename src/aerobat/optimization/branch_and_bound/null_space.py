"""Elimination of the equalities: the QP becomes the shortest vector that satisfies the range rows.

With w = √2 x the cost is ½|w|². The solutions of the equalities G w = d are w = G⁺ d + Z y. Z is an
orthonormal basis of the null space of G. In terms of y:

    cost = ½|y|² + ½|G⁺ d|²,      rows:  lower <= M y <= upper,   |M_i| = 1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, sqrt

import numpy as np

from aerobat.arrays import Array, Indices, Mask
from aerobat.optimization.assignment import AssignmentProgram, row_norms

UNBOUNDED = 1e30  # DAQP's value of an infinite bound
_RANK_TOLERANCE = 1e-11  # singular values below this fraction of the largest count as zero
_CONSTANT_ROW_TOLERANCE = 1e-9  # rows whose projection is below this fraction of their norm count as constant
# largest residual of redundant equalities and of constant rows, relative to their scale
_CONSISTENCY_TOLERANCE = 1e-7
_SCALE = sqrt(2.0)  # w over x


@dataclass(frozen=True, eq=False)
class ReducedBounds:
    """The bounds lower <= M y <= upper of a program in its null space, with y in units of `unit`."""

    lower: Array  # (m + 1,)
    upper: Array  # (m + 1,)
    base_cost: float  # the cost at y = 0, in units of unit²
    row_offset: Array  # (m + 1,) the program's rows at y = 0
    slack: Array  # (m + 1,) allowed violation of constant rows
    x_offset: Array  # (n,) x at y = 0
    min_norm: float  # lower bound of the norm of w
    consistent: bool  # False where equalities or constant rows contradict each other
    unit: float = 1.0

    def in_units(self, unit: float) -> ReducedBounds:
        """Return the bounds in units of `unit`, with DAQP's infinities. DAQP's tolerances are absolute."""
        lower = in_units(self.lower, unit)
        upper = in_units(self.upper, unit)
        return replace(self, lower=lower, upper=upper, base_cost=self.base_cost / unit**2, unit=unit)

    def cost(self, value: float) -> float:
        """Return the cost where ½|y|² is `value`."""
        return self.unit**2 * (self.base_cost + value)


@dataclass(frozen=True, eq=False)
class Block:
    """Variables of a program, and the rows that involve only these variables."""

    columns: Mask  # (n,)
    equalities: Mask  # (p,)
    rows: Mask  # (m,)


class NullSpace:
    """One block of a program, in the null space of its equalities.

    It depends only on the program's matrices; `bounds` adds the right-hand sides. One all-zero row,
    `zero_row`, is appended to the range rows. Stages with fewer rows than others are padded with it.
    """

    def __init__(self, program: AssignmentProgram, block: Block, implicit_equalities: Mask) -> None:
        """`implicit_equalities` (m,) marks the range rows whose two bounds are equal."""
        self.columns = np.flatnonzero(block.columns)
        self.ranges = np.flatnonzero(block.rows)
        self._equalities = np.flatnonzero(block.equalities)
        self._implicit_equalities = np.flatnonzero(block.rows & implicit_equalities)
        self._eliminate(program)
        self._project(program, implicit_equalities[self.ranges])

    def _eliminate(self, program: AssignmentProgram) -> None:
        rows = np.concatenate([program.equality[self._equalities], program.rows[self._implicit_equalities]])
        equality = rows[:, self.columns] / _SCALE
        norms = row_norms(equality)
        self._equality_scale = 1.0 / np.where(norms > 0.0, norms, 1.0)
        equality = equality * self._equality_scale[:, None]
        left, singular, right = np.linalg.svd(equality, full_matrices=True)
        rank = int((singular > _RANK_TOLERANCE * singular.max(initial=0.0)).sum())
        self._pseudo_inverse = right[:rank].T @ (left[:, :rank] / singular[:rank]).T
        self._residual_projector = np.eye(len(equality)) - equality @ self._pseudo_inverse
        self._x_from_target = self._pseudo_inverse / _SCALE
        self._x_from_y = right[rank:].T / _SCALE

    def _project(self, program: AssignmentProgram, fixed: Mask) -> None:
        rows = program.rows[self.ranges][:, self.columns]
        projected = rows @ self._x_from_y
        norm = row_norms(projected)
        self._row_norms = row_norms(rows / _SCALE)
        constant = (norm <= _CONSTANT_ROW_TOLERANCE * self._row_norms) | fixed
        norm[constant] = 1.0
        projected[constant] = 0.0
        self.constant = np.append(constant, True)
        self._projected_norms = np.append(norm, 1.0)
        self.zero_row = len(rows)
        self.rows = np.zeros((len(rows) + 1, projected.shape[1]))
        np.divide(projected, norm[:, None], out=self.rows[:-1])
        self._rows_from_target = rows @ self._x_from_target

    def bounds(self, program: AssignmentProgram, lower: Array, upper: Array) -> ReducedBounds:
        """Return the program's targets and the bounds (m,) of its range rows, reduced to the null space."""
        target = np.concatenate([program.target[self._equalities], lower[self._implicit_equalities]])
        target = target * self._equality_scale
        residual = np.abs(self._residual_projector @ target)
        norm = float(np.linalg.norm(self._pseudo_inverse @ target))
        offset = np.append(self._rows_from_target @ target, 0.0)
        slack = np.append(_CONSISTENCY_TOLERANCE * self._row_norms * norm, 0.0)
        low = self.normalized(np.append(lower[self.ranges], -inf), offset)
        high = self.normalized(np.append(upper[self.ranges], inf), offset)
        fits = (low <= slack) & (high >= -slack) | ~self.constant
        low = np.where(self.constant, -inf, low)
        high = np.where(self.constant, inf, high)
        max_residual = _CONSISTENCY_TOLERANCE * np.abs(target).max(initial=0.0)
        return ReducedBounds(
            lower=low,
            upper=high,
            base_cost=0.5 * norm**2,
            row_offset=offset,
            slack=slack,
            x_offset=self._x_from_target @ target,
            min_norm=max(norm, low.max(initial=0.0), -high.min(initial=0.0)),
            consistent=bool(fits.all() and (residual <= max_residual).all()),
        )

    def normalized(self, bound: Array, row_offset: Array, rows: Indices | slice = slice(None)) -> Array:
        """Return bounds of the program's rows, which are `row_offset` at y = 0, as bounds of M y."""
        normalized: Array = (bound - row_offset[rows]) / self._projected_norms[rows]
        return normalized

    def expand(self, bounds: ReducedBounds, y: Array) -> Array:
        """Return the variables x of this block at y."""
        x: Array = bounds.x_offset + self._x_from_y @ (bounds.unit * y)
        return x


def in_units(bound: Array, unit: float) -> Array:
    """Return `bound` / `unit`, with DAQP's infinities."""
    scaled: Array = np.clip(bound / unit, -UNBOUNDED, UNBOUNDED)
    return scaled


def split_coupled(program: AssignmentProgram, rows: Indices) -> tuple[Block, Block]:
    """Split a program in two independent blocks: everything coupled to range rows `rows`, and the rest."""
    incidence = np.abs(np.concatenate([program.equality, program.rows]))
    p = len(program.equality)
    columns: Mask = np.any(incidence[p + rows], axis=0)
    while True:
        touched = incidence @ columns > 0.0
        coupled = columns | (touched @ incidence > 0.0)
        if (coupled == columns).all():
            break
        columns = coupled
    equalities = touched[:p]
    ranges = touched[p : p + len(program.rows)]
    ranges[rows] = True
    return Block(columns, equalities, ranges), Block(~columns, ~equalities, ~ranges)
