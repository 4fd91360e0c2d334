"""Dense matrices as matrices with a band and a border, and back."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerobat.optimization.bordered_band import BorderedBand, Pattern

Array = NDArray[np.float64]


def bordered_band(matrix: Array, border: int = 1, width: int | None = None) -> BorderedBand:
    """A symmetric matrix (n, n) with a border of that many rows; by default its band is full."""
    size = len(matrix)
    pattern = Pattern(size, border, max(size - border - 1, 0) if width is None else width)
    rows, columns = np.tril_indices(size)
    stored = (rows >= pattern.inner) | (rows - columns <= pattern.width)
    values = np.zeros(pattern.entries)
    values[pattern.index(rows[stored], columns[stored])] = matrix[rows[stored], columns[stored]]
    return BorderedBand(pattern, values)


def dense(matrix: BorderedBand) -> Array:
    """The matrix (n, n) with all its entries."""
    rows, columns = np.tril_indices(matrix.pattern.size)
    stored = (rows >= matrix.pattern.inner) | (rows - columns <= matrix.pattern.width)
    rows, columns = rows[stored], columns[stored]
    found = np.zeros((matrix.pattern.size, matrix.pattern.size))
    found[rows, columns] = found[columns, rows] = matrix.values[matrix.pattern.index(rows, columns)]
    return found
