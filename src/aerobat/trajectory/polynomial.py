"""Vector polynomials p(s) = Σ c_k s^k in normalised time s ∈ [0, 1]; leading axes broadcast.

Coefficients have the shape (..., K, D): K = degree + 1 powers, rising, of D components. Derivatives are with
respect to s; divide the k-th one by T^k for a segment of duration T.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerobat.arrays import Array

# smaller leading coefficients, relative to the largest, are dropped: they spoil a companion matrix
NEGLIGIBLE_LEADING = 1e-11


def differentiate(coefficients: Array, order: int = 1) -> Array:
    """Return coefficients of the `order`-th derivative, (..., K, D) -> (..., max(K - order, 1), D)."""
    size = coefficients.shape[-2]
    if order >= size:
        return np.zeros_like(coefficients[..., :1, :])
    factors = np.array([math.perm(power, order) for power in range(order, size)], dtype=float)
    return np.asarray(factors[:, None] * coefficients[..., order:, :])


def evaluate(coefficients: Array, s: ArrayLike) -> Array:
    """Return p(s) by Horner's rule; s (...) broadcasts with the leading axes: (..., K, D) -> (..., D)."""
    s = np.asarray(s, dtype=float)[..., None]
    value = coefficients[..., -1, :] + 0.0 * s
    for power in range(coefficients.shape[-2] - 2, -1, -1):
        value *= s
        value += coefficients[..., power, :]
    return np.asarray(value)


def hermite(left: Array, right: Array) -> Array:
    """Return the polynomials of degree 2r - 1 with given derivatives 0..r-1 at s = 0 and s = 1.

    Derivatives are with respect to s: (..., r, D) twice -> (..., 2r, D).
    """
    count = left.shape[-2]
    at_end = np.array(
        [[math.perm(power, k) for power in range(2 * count)] for k in range(count)], dtype=float
    )
    low = left / np.array([math.factorial(k) for k in range(count)])[:, None]
    high = np.linalg.inv(at_end[:, count:]) @ (right - at_end[:, :count] @ low)
    return np.concatenate([low, high], axis=-2)


def restricted(coefficients: Array, start: Array, length: Array) -> Array:
    """Return coefficients (n, K, D) of p(start + length s), for a part of each polynomial's [0, 1]."""
    powers = np.arange(coefficients.shape[-2])
    binomial = np.array([[math.comb(high, low) for high in powers] for low in powers], dtype=float)
    rising = np.maximum(powers - powers[:, None], 0)
    shift = binomial * start[:, None, None] ** rising * length[:, None, None] ** powers[:, None]
    return np.asarray(shift @ coefficients)


def gram(degree: int, derivative: int) -> Array:
    """Return Q with ∫₀¹ (dᵏp/dsᵏ)² ds = cᵀ Q c for the coefficients c of one component, (K, K)."""
    powers = np.arange(degree + 1)
    factors = np.array([math.perm(power, derivative) for power in range(degree + 1)], dtype=float)
    exponents = powers[:, None] + powers[None, :] - 2 * derivative + 1
    products = np.outer(factors, factors)  # zero wherever the exponent is below one
    return np.asarray(np.where(products > 0, products / np.maximum(exponents, 1), 0.0))


def squared_norm(coefficients: Array) -> Array:
    """Return coefficients of |p(s)|², (..., K, D) -> (..., 2K - 1)."""
    size = coefficients.shape[-2]
    products = coefficients @ np.swapaxes(coefficients, -1, -2)
    result = np.zeros((*coefficients.shape[:-2], 2 * size - 1))
    for power in range(size):
        result[..., power : power + size] += products[..., power, :]
    return result


def stationary_points(coefficients: Array) -> Array:
    """Return points of [0, 1] where |p(s)|² may be extreme: both ends and its derivative's interior roots.

    (S, K, D) -> (S, n), a fixed number per polynomial. Complex roots are replaced by their real part, and
    roots outside are moved to the nearer end: such extra candidates are harmless and need no tolerance. Each
    root is repeated after one Newton step, which restores the digits that eigenvalues lose.
    """
    squares = squared_norm(coefficients)
    slopes = differentiate(squares[..., None])[..., 0]
    roots = np.clip(_roots(slopes), 0.0, 1.0)
    ends = np.broadcast_to([0.0, 1.0], (len(roots), 2))
    return np.concatenate([ends, roots, np.clip(_newton_step(slopes, roots), 0.0, 1.0)], axis=1)


def _newton_step(coefficients: Array, s: Array) -> Array:
    """Return s (S, n) after one Newton step towards a root of its scalar polynomial (S, m)."""
    vectors = coefficients[:, None, :, None]
    value, slope = (evaluate(differentiate(vectors, order), s)[..., 0] for order in (0, 1))
    useful = np.abs(slope) > np.abs(value)  # a longer step leaves [0, 1]
    return np.asarray(s - np.divide(value, slope, out=np.zeros_like(s), where=useful))


def _roots(coefficients: Array) -> Array:
    """Return real parts of the roots of scalar polynomials, (S, m) rising powers -> (S, max(m - 1, 0)).

    Missing roots of polynomials of lower true degree are zero. The roots are eigenvalues of companion
    matrices, one batch for each true degree, because a companion matrix needs a nonzero leading coefficient.
    """
    roots = np.zeros((len(coefficients), max(coefficients.shape[1] - 1, 0)))
    degrees = _true_degrees(coefficients)
    for degree in sorted(set(degrees[degrees > 0].tolist())):
        rows = np.flatnonzero(degrees == degree)
        companion = np.zeros((len(rows), degree, degree))
        companion[:, np.arange(1, degree), np.arange(degree - 1)] = 1.0
        companion[:, :, -1] = -coefficients[rows, :degree] / coefficients[rows, degree, None]
        roots[rows, :degree] = np.linalg.eigvals(companion).real
    return roots


def _true_degrees(coefficients: Array) -> NDArray[np.intp]:
    """Return the highest power whose coefficient is not negligible, zero for constants: (S, m) -> (S,)."""
    magnitudes = np.abs(coefficients)
    largest = magnitudes.max(axis=1, keepdims=True, initial=0.0)
    powers = np.arange(coefficients.shape[1])
    return np.asarray(np.where(magnitudes > NEGLIGIBLE_LEADING * largest, powers, 0).max(axis=1, initial=0))
