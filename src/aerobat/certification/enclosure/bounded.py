"""Verified arithmetic: analytic functions on pieces, with bounds in the complex plane and error bounds.

A function has values at nodes, bounds of its magnitude on Bernstein ellipses around the piece, and a bound of
the error of its values on the piece. Sums, products and inverses propagate all three. Kernels run on these
functions as on numbers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerobat.arrays import Array
from aerobat.certification.enclosure import chebyshev

ROUNDING = 4 * np.finfo(float).eps  # relative rounding error of one operation, real or complex


@dataclass(frozen=True, eq=False)
class Bounded:
    """Functions on P pieces. The first ellipse of `bound` is the piece itself."""

    values: Array  # at the nodes, (P, N)
    bound: Array  # bounds of magnitudes on R ellipses, (P, R)
    error: Array  # largest error of the values on the piece, (P,)

    __array_ufunc__ = None  # makes NumPy's numbers use the operators of this class

    def __add__(self, other: Bounded | float) -> Bounded:
        if not isinstance(other, Bounded):
            return self if other == 0.0 else self + self.constant(other)
        bound = self.bound + other.bound
        error = self.error + other.error + ROUNDING * bound[:, 0]
        return Bounded(self.values + other.values, bound, error)

    __radd__ = __add__

    def __mul__(self, other: Bounded | float) -> Bounded:
        if not isinstance(other, Bounded):
            if other == 0.0:
                return self.constant(0.0)
            bound = abs(other) * self.bound
            error = abs(other) * self.error + ROUNDING * bound[:, 0]
            return Bounded(other * self.values, bound, error)
        bound = self.bound * other.bound
        error = self.bound[:, 0] * other.error + self.error * (other.bound[:, 0] + other.error)
        return Bounded(self.values * other.values, bound, error + ROUNDING * bound[:, 0])

    __rmul__ = __mul__

    def __neg__(self) -> Bounded:
        return Bounded(-self.values, self.bound, self.error)

    def __sub__(self, other: Bounded | float) -> Bounded:
        return self + -other

    def __rsub__(self, other: float) -> Bounded:
        return -self + other

    def constant(self, value: float) -> Bounded:
        """Return a constant on the same pieces."""
        shape, bound = np.zeros_like(self.values), np.full_like(self.bound, abs(value))
        return Bounded(shape + value, bound, np.zeros_like(self.error))

    def with_error(self, error: Array) -> Bounded:
        """Return the same functions with the error of their values increased by `error`, (P,)."""
        return Bounded(self.values, self.bound, self.error + error)

    def inverse(self, least: Array) -> Bounded:
        """Return 1/x, where |x| is at least `least` on the ellipses, (P, R); values <= 0 bound nothing."""
        known = least > 0.0
        bound = np.where(known, 1.0 / np.where(known, least, 1.0), np.inf)
        left = least[:, 0] - self.error
        safe = np.where(left > 0.0, left, 1.0)
        error = np.where(left > 0.0, bound[:, 0] * (self.error / safe + ROUNDING), np.inf)
        return Bounded(1.0 / self.values, bound, error)


@dataclass(frozen=True)
class Polynomials:
    """Polynomials on pieces, from their values at the nodes of a basis of sufficient degree."""

    values: Array  # (P, N)
    basis: chebyshev.Basis
    rho: Array  # (R,), the first 1

    @property
    def _terms(self) -> tuple[Array, Array]:
        """The magnitudes of the Chebyshev coefficients, (P, N), and their rounding errors, (P, 1)."""
        rounding = chebyshev.EVALUATION_ROUNDING * np.abs(self.values).max(axis=1, keepdims=True)
        return np.abs(self.values @ self.basis.analysis.T), rounding

    @property
    def _growth(self) -> Array:
        return chebyshev.growth(self.basis.degree, self.rho)

    def bound(self) -> Array:
        """Return upper bounds of the magnitudes on the ellipses, (P, R)."""
        terms, rounding = self._terms
        return np.asarray((terms + rounding) @ self._growth)

    def least(self) -> Array:
        """Return lower bounds of the magnitudes on the ellipses, (P, R); values <= 0 bound nothing."""
        terms, rounding = self._terms
        return np.asarray(terms[:, :1] - rounding - (terms[:, 1:] + rounding) @ self._growth[1:])

    def bounded(self) -> Bounded:
        """Return the polynomials as bounded functions."""
        bound = self.bound()
        return Bounded(self.values, bound, chebyshev.EVALUATION_ROUNDING * bound[:, 0])
