"""Chebyshev series on [-1, 1]: interpolation, halving, and bounds on Bernstein ellipses."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev

from aerobat.arrays import Array

# relative to the sum of absolute values of a polynomial's terms: rounding of Horner's rule and its argument
EVALUATION_ROUNDING = 1e-14


@dataclass(frozen=True)
class Basis:
    """Nodes and matrices of interpolation of degree K; a series is a row of coefficients of Σ c_k T_k."""

    nodes: Array  # Chebyshev points, including both ends, (K + 1,)
    analysis: Array  # values at the nodes -> coefficients, (K + 1, K + 1)
    halves: Array  # coefficients -> coefficients of either half, stretched to [-1, 1], (2, K + 1, K + 1)
    derivative: Array  # coefficients -> coefficients of the derivative, (K + 1, K + 1)

    @property
    def degree(self) -> int:
        """The degree K."""
        return len(self.nodes) - 1

    @property
    def lebesgue(self) -> float:
        """The Lebesgue constant: amplification of errors of values (Trefethen, ATAP, theorem 15.2)."""
        return float(1 + 2 / np.pi * np.log(self.degree + 1))

    @property
    def steepening(self) -> float:
        """Largest amplification of errors of values by the derivative (Duffin and Schaeffer, 1941)."""
        return float(self.degree**2)

    def parts(self, low: Array, high: Array) -> Array:
        """Return matrices like `halves`, for parts from low to high in [0, 1] (n,), (n, K + 1, K + 1)."""
        at = 2 * low[:, None] - 1 + (high - low)[:, None] * (1 + self.nodes)
        return _parts(self.analysis, at)


@lru_cache(maxsize=16)
def basis(degree: int) -> Basis:
    """Return the basis of a degree >= 1."""
    nodes = np.asarray(-np.cos(np.pi * np.arange(degree + 1) / degree))
    analysis = np.linalg.inv(chebyshev.chebvander(nodes, degree))
    halves = _parts(analysis, np.array([(nodes + side) / 2 for side in (-1, 1)]))
    derivative = np.zeros((degree + 1, degree + 1))
    derivative[:-1] = chebyshev.chebder(np.eye(degree + 1))
    return Basis(nodes, np.asarray(analysis), halves, derivative)


def _parts(analysis: Array, at: Array) -> Array:
    """Return the matrices from coefficients to those of parts with nodes at the points `at` (n, K + 1)."""
    # a term of a part depends only on terms of at least its degree; triu removes the rounding of large lower
    # terms
    return np.triu(analysis @ chebyshev.chebvander(at, at.shape[1] - 1))


def growth(degree: int, rho: Array) -> Array:
    """Return the largest |T_k| on Bernstein ellipses, (ρᵏ + ρ⁻ᵏ)/2, (K + 1, R); ρ = 1 is the interval."""
    return np.asarray(np.cosh(np.multiply.outer(np.arange(degree + 1), np.log(rho))))


def tails(degree: int, rho: Array) -> tuple[Array, Array]:
    """Return Σ 4 ρ⁻ᵏ and Σ 4 k² ρ⁻ᵏ over all k beyond a degree, (R,) each.

    For a function that is at most 1 on the ellipse ρ, these sums bound the interpolation error on [-1, 1] of
    this degree, and the error of its derivative.
    """
    x, m = 1 / rho, degree + 1
    first = 4 * x**m / (1 - x)
    return first, first * (m**2 + 2 * m * x / (1 - x) + x * (1 + x) / (1 - x) ** 2)


def integral(values: Array, basis: Basis) -> Array:
    """Return ∫ from -1 to each node of a function with these values at the nodes, (..., K + 1)."""
    series = chebyshev.chebint(values @ basis.analysis.T, lbnd=-1, axis=-1)
    return np.asarray(series @ chebyshev.chebvander(basis.nodes, basis.degree + 1).T)


def evaluate(coefficients: Array, at: Array) -> Array:
    """Return the values of each series (N, K + 1) at its own point (N,)."""
    return np.asarray(chebyshev.chebval(at, coefficients.T, tensor=False))
