"""Symmetric matrices of a chain of segments, and their Cholesky factors.

The variables of a segment couple with those of its neighbours only, which gives a band. A few others, such as
the durations of segments, may couple with all. They come last and give the border: full rows at the end. A
factorization takes time in proportion to the number of segments for the band, and with its square for a
border that grows along. A dense matrix would take the cube.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg.lapack import dpbtrf, dpotrf, dtbtrs, dtrtrs
from scipy.sparse import coo_array, csr_array

from aerobat.arrays import Array, Indices, Mask


@dataclass(frozen=True)
class Pattern:
    """The places of entries in the lower triangle of symmetric matrices (n, n) with a band and a border."""

    size: int  # the number n of rows
    border: int  # the number of last rows that are full, at least one
    width: int  # the largest distance of an entry from the diagonal in the rows before the border

    @property
    def inner(self) -> int:
        """The number m of rows before the border."""
        return self.size - self.border

    @property
    def entries(self) -> int:
        """The number of stored values."""
        return self.inner * (self.width + 1) + self.border * self.size

    def index(self, rows: Indices, columns: Indices) -> Indices:
        """Return where the values of entries are stored: columns of the band, then rows of the border.

        Args:
            rows: The rows of entries of the lower triangle, in any shape.
            columns: Their columns, none larger than the row.
        """
        in_band = columns * (self.width + 1) + rows - columns
        in_border = self.inner * (self.width + 1) + (rows - self.inner) * self.size + columns
        return np.where(rows < self.inner, in_band, in_border)

    def has_squares(self, rows: Array) -> Mask:
        """Return whether the square of each row lies in the band and the border, (q,).

        Args:
            rows: Rows (q, n). Those that couple distant segments, as of a whole lap, lie outside.
        """
        inner = rows[:, : self.inner] != 0.0
        first, last = inner.argmax(axis=1), self.inner - 1 - inner[:, ::-1].argmax(axis=1)
        return np.asarray(~inner.any(axis=1) | (last - first <= self.width))

    @cached_property
    def diagonal(self) -> Indices:
        """The indices of the values of the diagonal, (n,)."""
        return self.index(np.arange(self.size), np.arange(self.size))


@dataclass(frozen=True, eq=False)
class BorderedBand:
    """A symmetric matrix with a band and a border, of which the lower triangle is stored."""

    pattern: Pattern
    values: Array  # (entries,)

    @property
    def diagonal(self) -> Array:
        """The diagonal, (n,)."""
        return np.asarray(self.values[self.pattern.diagonal])

    @property
    def band(self) -> Array:
        """The band as LAPACK stores it: its diagonals (width + 1, m), the main one first."""
        count = self.pattern.inner * (self.pattern.width + 1)
        return self.values[:count].reshape(self.pattern.inner, -1).T

    @property
    def border(self) -> Array:
        """The last rows, (border, n); above the diagonal their entries are zero."""
        return self.values[-self.pattern.border * self.pattern.size :].reshape(self.pattern.border, -1)

    def plus_diagonal(self, added: Array | float) -> BorderedBand:
        """Return the matrix with numbers, (n,) or one for all, added to its diagonal."""
        values = self.values.copy()
        values[self.pattern.diagonal] += added
        return BorderedBand(self.pattern, values)

    def plus_squares(self, rows: Array, weights: Array | float) -> BorderedBand:
        """Return the matrix with rowsᵀ diag(weights) rows added.

        Args:
            rows: Rows (q, n) whose squares lie in the band and the border (`Pattern.has_squares`).
            weights: One weight a row, (q,), or one for all.
        """
        sparse = csr_array(rows)
        added = coo_array(sparse.T @ (sparse * np.reshape(weights, (-1, 1))))
        lower = added.row >= added.col
        where = self.pattern.index(added.row[lower].astype(np.intp), added.col[lower].astype(np.intp))
        values = self.values.copy()
        values[where] += added.data[lower]
        return BorderedBand(self.pattern, values)

    def cholesky(self) -> BorderedCholesky | None:
        """Return the Cholesky factors, or None for a matrix that is not positive definite."""
        inner = self.pattern.inner
        band, failed = dpbtrf(self.band, lower=1)
        if failed:
            return None
        coupling, _ = dtbtrs(band, self.border[:, :inner].T, uplo="L")
        corner, failed = dpotrf(self.border[:, inner:] - coupling.T @ coupling, lower=1)
        return None if failed else BorderedCholesky(band, coupling, corner)


@dataclass(frozen=True, eq=False)
class BorderedCholesky:
    """The Cholesky factor L of a matrix L Lᵀ with a band and a border.

    Everything is solved with L and its transpose, which is stable: barrier functions make matrices whose
    inverses would lose all digits.
    """

    band: Array  # the factor of the band, as LAPACK stores it, (width + 1, m)
    coupling: Array  # the transposed last rows of the factor, below its band, (m, border)
    corner: Array  # the last rows and columns of the factor, (border, border)

    def solve(self, right: Array) -> Array:
        """Return the solution x of L Lᵀ x = right, (n,)."""
        return self.backward(self.forward(right))

    def forward(self, right: Array) -> Array:
        """Return the solution x of L x = right, (n,) or (n, r)."""
        if not right.size:  # dtbtrs of SciPy 1.17 would write outside its arrays
            return right
        inner = len(self.coupling)
        first, _ = dtbtrs(self.band, right[:inner], uplo="L")
        last, _ = dtrtrs(self.corner, right[inner:] - self.coupling.T @ first, lower=1)
        return np.concatenate([first, last])

    def backward(self, right: Array) -> Array:
        """Return the solution x of Lᵀ x = right, (n,)."""
        inner = len(self.coupling)
        last, _ = dtrtrs(self.corner, right[inner:], lower=1, trans=1)
        first, _ = dtbtrs(self.band, right[:inner] - self.coupling @ last, uplo="L", trans="T")
        return np.concatenate([first, last])
