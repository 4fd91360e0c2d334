"""Chebyshev series on [-1, 1]: interpolation, halving, and how large they are off the real line."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev

from aerobat.arrays import Array

# of the sum of absolute values behind a polynomial's value: Horner's rule and its argument
EVALUATION_ROUNDING = 1e-14


@dataclass(frozen=True)
class Basis:
    """Nodes and matrices of interpolation of one degree K; series are rows of coefficients of Σ c_k T_k."""

    nodes: Array  # Chebyshev points, both ends among them, (K + 1,)
    analysis: Array  # values at the nodes -> coefficients, (K + 1, K + 1)
    halves: Array  # coefficients -> those of either half, stretched to [-1, 1], (2, K + 1, K + 1)
    derivative: Array  # coefficients -> those of the derivative, (K + 1, K + 1)

    @property
    def degree(self) -> int:
        """K."""
        return len(self.nodes) - 1

    @property
    def lebesgue(self) -> float:
        """By how much interpolation magnifies errors of values, at most (Trefethen, ATAP, theorem 15.2)."""
        return float(1 + 2 / np.pi * np.log(self.degree + 1))

    @property
    def steepening(self) -> float:
        """By how much its derivative magnifies errors of values, at most (Duffin and Schaeffer, 1941)."""
        return float(self.degree**2)

    def parts(self, low: Array, high: Array) -> Array:
        """Return the matrices as `halves`, of parts from low to high in [0, 1] (n,), (n, K + 1, K + 1)."""
        at = 2 * low[:, None] - 1 + (high - low)[:, None] * (1 + self.nodes)
        return _parts(self.analysis, at)


@lru_cache(maxsize=16)
def basis(degree: int) -> Basis:
    """The basis of a degree >= 1."""
    nodes = np.asarray(-np.cos(np.pi * np.arange(degree + 1) / degree))
    analysis = np.linalg.inv(chebyshev.chebvander(nodes, degree))
    halves = _parts(analysis, np.array([(nodes + side) / 2 for side in (-1, 1)]))
    derivative = np.zeros((degree + 1, degree + 1))
    derivative[:-1] = chebyshev.chebder(np.eye(degree + 1))
    return Basis(nodes, np.asarray(analysis), halves, derivative)


def _parts(analysis: Array, at: Array) -> Array:
    """The matrices of coefficients -> those of parts whose nodes are at such points (n, K + 1)."""
    # a part's term is made of terms of no lower degree: rounding of large ones would be left in all others
    return np.triu(analysis @ chebyshev.chebvander(at, at.shape[1] - 1))


def growth(degree: int, rho: Array) -> Array:
    """The largest |T_k| on Bernstein ellipses, (ρᵏ + ρ⁻ᵏ)/2, (K + 1, R); one for ρ = 1, the interval."""
    return np.asarray(np.cosh(np.multiply.outer(np.arange(degree + 1), np.log(rho))))


def tails(degree: int, rho: Array) -> tuple[Array, Array]:
    """Σ 4 ρ⁻ᵏ and Σ 4 k² ρ⁻ᵏ over all k beyond a degree, (R,) each.

    So far, on [-1, 1], are interpolants of this degree from a function that is at most 1 on the ellipse ρ,
    and their derivatives from its derivative.
    """
    x, m = 1 / rho, degree + 1
    first = 4 * x**m / (1 - x)
    return first, first * (m**2 + 2 * m * x / (1 - x) + x * (1 + x) / (1 - x) ** 2)


def integral(values: Array, basis: Basis) -> Array:
    """∫ from -1 to each node of what has these values at the nodes, along the last axis, (..., K + 1)."""
    series = chebyshev.chebint(values @ basis.analysis.T, lbnd=-1, axis=-1)
    return np.asarray(series @ chebyshev.chebvander(basis.nodes, basis.degree + 1).T)


def evaluate(coefficients: Array, at: Array) -> Array:
    """Each series (N, K + 1) at its own point (N,)."""
    return np.asarray(chebyshev.chebval(at, coefficients.T, tensor=False))
