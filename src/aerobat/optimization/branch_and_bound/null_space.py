"""The equalities eliminated: what is left is the shortest vector that satisfies the range rows.

With H = L Lᵀ and w = Lᵀ x + L⁻¹ f the cost is ½|w|² plus a constant. The equalities G w = d leave
w = G⁺ d + Z y, Z an orthonormal basis of the null space of G, so that

    cost = ½|y|² + ½|G⁺ d|² + constant,      rows:  lower <= M y <= upper,   |M_i| = 1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, sqrt

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization.assignment import AssignmentProgram, Indices, Mask, lengths

UNBOUNDED = 1e30  # an infinite bound, as DAQP writes it
_VANISHED = 1e-9  # a row shorter than this share of its length has no free direction left
_ROOT = sqrt(2.0)
_RANK = 1e-11  # singular values below this share of the largest are zero
_CONSISTENT = (
    1e-7  # residual of redundant equalities and of rows without freedom, relative to max(1, |bound|)
)


@dataclass(frozen=True, eq=False)
class Bounds:
    """lower <= M y <= upper, y in units of `unit`: what a program's right-hand sides become."""

    lower: Array  # (m + 1,)
    upper: Array  # (m + 1,)
    base: float  # the cost at y = 0, in units of unit²
    shift: Array  # (m + 1,) the program's rows at y = 0
    slack: Array  # (m + 1,) how far rows without freedom may miss their bounds
    origin: Array  # (n,) x at y = 0
    size: float  # no solution has a shorter w
    consistent: bool  # False where equalities, or rows without freedom, contradict each other
    unit: float = 1.0

    def over(self, unit: float) -> Bounds:
        """The same in units of `unit`, infinities as DAQP writes them: its tolerances are absolute."""
        lower, upper = in_units(self.lower, unit), in_units(self.upper, unit)
        return replace(self, lower=lower, upper=upper, base=self.base / unit**2, unit=unit)

    def cost(self, value: float) -> float:
        """The cost where ½|y|² is `value`."""
        return self.unit**2 * (self.base + value)


@dataclass(frozen=True, eq=False)
class Part:
    """Some variables, and the rows that speak of them and of no others."""

    columns: Mask  # (n,)
    equalities: Mask  # (p,)
    rows: Mask  # (m,)


class Reduction:
    """Some variables of a program that no row links to the others, in the null space of their equalities.

    Depends on the program's matrices alone; `bounds` brings the bounds in. One all-zero row, `zero`, is
    appended to the range rows: whatever has fewer rows than its fellows points there.
    """

    def __init__(self, program: AssignmentProgram, part: Part, pinned: Mask) -> None:
        """`pinned` (m,) marks the range rows that are equalities, whatever dt."""
        self.columns, self.ranges = np.flatnonzero(part.columns), np.flatnonzero(part.rows)
        self.equalities = np.flatnonzero(part.equalities)
        self.pinned = np.flatnonzero(part.rows & pinned)
        whitening = _Whitening(program, self.columns)
        self._eliminate(program, whitening)
        self._project(program, whitening, pinned[self.ranges])

    def _eliminate(self, program: AssignmentProgram, whitening: _Whitening) -> None:
        stacked = np.concatenate([program.equality[self.equalities], program.rows[self.pinned]])
        stacked = stacked[:, self.columns]
        equality = whitening.rows(stacked)
        length = lengths(equality)
        self._unit = 1.0 / np.where(length > 0.0, length, 1.0)
        equality = equality * self._unit[:, None]
        left, singular, right = np.linalg.svd(equality, full_matrices=True)
        rank = int((singular > _RANK * singular.max(initial=0.0)).sum())
        pseudo_inverse = right[:rank].T @ (left[:, :rank] / singular[:rank]).T
        self._least = pseudo_inverse
        self._inconsistency = np.eye(len(equality)) - equality @ pseudo_inverse
        self._offset = float(np.linalg.norm(whitening.offset))
        self._centre = -whitening.lifted(whitening.offset)
        self._centre_equality = stacked @ self._centre
        self._from_target = whitening.lifted(pseudo_inverse)
        self.from_free = whitening.lifted(right[rank:].T)

    def _project(self, program: AssignmentProgram, whitening: _Whitening, pinned: Mask) -> None:
        rows = program.rows[self.ranges][:, self.columns]
        projected, self._length = rows @ self.from_free, lengths(whitening.rows(rows))
        norm = lengths(projected)
        constant = (norm <= _VANISHED * self._length) | pinned
        norm[constant] = 1.0
        projected[constant] = 0.0
        self.constant, self.norm = np.append(constant, True), np.append(norm, 1.0)
        self.zero = len(rows)  # the appended row
        self.rows = np.zeros((len(rows) + 1, projected.shape[1]))
        np.divide(projected, norm[:, None], out=self.rows[:-1])
        self._rows_from_target = rows @ self._from_target
        self._rows_centre = rows @ self._centre

    def bounds(self, program: AssignmentProgram, lower: Array, upper: Array) -> Bounds:
        """What is left of the program's targets and of the given bounds (m,) of its range rows."""
        target = np.concatenate([program.target[self.equalities], lower[self.pinned]])
        target = (target - self._centre_equality) * self._unit
        least, missed = self._least @ target, np.abs(self._inconsistency @ target)
        size = float(np.linalg.norm(least))
        shift = np.append(self._rows_centre + self._rows_from_target @ target, 0.0)
        slack = np.append(_CONSISTENT * self._length * np.hypot(size, self._offset), 0.0)
        low = self.scaled(np.append(lower[self.ranges], -inf), shift)
        high = self.scaled(np.append(upper[self.ranges], inf), shift)
        fits = (low <= slack) & (high >= -slack) | ~self.constant
        low, high = np.where(self.constant, -inf, low), np.where(self.constant, inf, high)
        return Bounds(
            lower=low,
            upper=high,
            base=0.5 * (size**2 - self._offset**2),
            shift=shift,
            slack=slack,
            origin=self._centre + self._from_target @ target,
            size=max(size, low.max(initial=0.0), -high.min(initial=0.0)),
            consistent=bool(fits.all() and (missed <= _CONSISTENT * np.abs(target).max(initial=0.0)).all()),
        )

    def scaled(self, bound: Array, shift: Array, rows: Indices | slice = slice(None)) -> Array:
        """`bound`, of the program's rows, which are `shift` at y = 0, as a bound of M y."""
        scaled: Array = (bound - shift[rows]) / self.norm[rows]
        return scaled

    def lifted(self, at: Bounds, y: Array) -> Array:
        """The variables x of this part at y."""
        x: Array = at.origin + self.from_free @ (at.unit * y)
        return x


def in_units(bound: Array, unit: float) -> Array:
    """`bound` / `unit`, infinities as DAQP writes them."""
    scaled: Array = np.clip(bound / unit, -UNBOUNDED, UNBOUNDED)
    return scaled


def parts(program: AssignmentProgram, rows: Indices) -> tuple[Part, Part]:
    """The program split in two that share nothing: all that range rows `rows` are linked to, and the rest."""
    links = [np.abs(program.equality), np.abs(program.rows)]
    if program.hessian is not None:
        links.append(np.abs(program.hessian))
    incidence = np.concatenate(links)
    columns: Mask = np.any(incidence[len(program.equality) + rows], axis=0)
    while True:
        touched = incidence @ columns > 0.0
        linked = columns | (touched @ incidence > 0.0)
        if (linked == columns).all():
            break
        columns = linked
    equalities, ranges = (
        touched[: len(program.equality)],
        touched[len(program.equality) :][: len(program.rows)],
    )
    ranges[rows] = True
    return Part(columns, equalities, ranges), Part(~columns, ~equalities, ~ranges)


class _Whitening:
    """x = L⁻ᵀ (w − offset), with L = √2 where the program has no hessian."""

    def __init__(self, program: AssignmentProgram, columns: Indices) -> None:
        gradient = np.zeros(len(columns)) if program.gradient is None else program.gradient[columns]
        self._inverse: Array | None = None
        self.offset = gradient / _ROOT  # L⁻¹ f
        if program.hessian is not None:
            self._inverse = np.linalg.inv(np.linalg.cholesky(program.hessian[np.ix_(columns, columns)]))
            self.offset = self._inverse @ gradient

    def rows(self, matrix: Array) -> Array:
        """Rows over x as rows over w."""
        return matrix / _ROOT if self._inverse is None else matrix @ self._inverse.T

    def lifted(self, vectors: Array) -> Array:
        """L⁻ᵀ times vectors w, its columns."""
        return vectors / _ROOT if self._inverse is None else self._inverse.T @ vectors
