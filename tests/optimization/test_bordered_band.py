"""Matrices with a band and a border: NumPy's answers for the same matrices, dense."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from bordered_bands import Array, bordered_band, dense


@st.composite
def chains(draw: st.DrawFn) -> tuple[Array, int, int]:
    """A symmetric matrix with a band and a border, positive definite or not, its border and its width."""
    rng = np.random.default_rng(draw(st.integers(0, 2**31)))
    inner, border, width = (draw(st.integers(*ends)) for ends in ((1, 12), (1, 4), (0, 5)))
    size = inner + border
    matrix = rng.normal(size=(size, size))
    matrix += matrix.T + draw(st.floats(0.0, 12.0)) * np.eye(size)
    rows, columns = np.indices((size, size))
    apart = (np.abs(rows - columns) > width) & (np.maximum(rows, columns) < inner)
    return np.where(apart, 0.0, matrix), border, width


@given(chain=chains(), columns=st.integers(0, 3), seed=st.integers(0, 2**31))
def test_equations_are_solved_as_numpy_solves_them_or_found_not_positive_definite(
    chain: tuple[Array, int, int], columns: int, seed: int
) -> None:
    matrix, border, width = chain
    right = np.random.default_rng(seed).normal(size=(len(matrix), columns + 1))
    factors = bordered_band(matrix, border, width).cholesky()
    least = np.linalg.eigvalsh(matrix)[0]
    if factors is None:
        assert least < 1e-9
        return
    assert least > -1e-9
    np.testing.assert_allclose(
        matrix @ factors.solve(right[:, 0]), right[:, 0], atol=1e-9 * max(1.0, 1.0 / abs(least))
    )
    moved = factors.forward(right[:, 1:])
    assert moved.shape == (len(matrix), columns)
    expected = right[:, 1:].T @ np.linalg.solve(matrix, right[:, 1:])
    np.testing.assert_allclose(moved.T @ moved, expected, rtol=1e-6, atol=1e-9 * max(1.0, 1.0 / abs(least)))


@given(chain=chains(), seed=st.integers(0, 2**31))
def test_diagonals_and_squares_of_rows_are_added_where_they_belong(
    chain: tuple[Array, int, int], seed: int
) -> None:
    matrix, border, width = chain
    rng = np.random.default_rng(seed)
    rows = np.zeros((5, len(matrix)))
    for row in rows:  # each has entries for neighbours in the band, and for the border
        first = rng.integers(len(matrix) - border)
        row[first : min(first + width + 1, len(matrix) - border)] = rng.normal()
        row[-border:] = rng.normal(size=border)
    weights, added = rng.normal(size=5), rng.normal(size=len(matrix))
    found = bordered_band(matrix, border, width).plus_squares(rows, weights).plus_diagonal(added)
    expected = matrix + rows.T @ np.diag(weights) @ rows + np.diag(added)
    np.testing.assert_allclose(dense(found), expected, atol=1e-12)
    np.testing.assert_allclose(found.diagonal, np.diag(expected), atol=1e-12)
