"""Conditions on polynomial segments at their knots, as one banded linear system with linear cost in segments.

A component of n segments of degree 2s - 1 has 2s·n coefficients, of the powers of normalised segment time,
and as many conditions: s at each end of the course, 2s at each inner knot. For a segment of duration T, the
condition on derivative d reads

    (u/T)^d Σ_j C(j, d) c_j   at its end,      (u/T)^d c_d   at its beginning.

Both are the d-th derivative divided by d!, with time in units of u, the geometric mean of all durations. Rows
scaled in this way keep more digits than equilibrated ones when durations differ by orders of magnitude.
Iterative refinement with residuals in extended precision restores the digits that the factorization in
float64 loses (Higham, "Accuracy and Stability of Numerical Algorithms", chapter 12).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array, Mask, frozen
from aerobat.errors import SpecError

Extended = NDArray[np.longdouble]  # 80 bits where the machine supports them, else float64

# passes of iterative refinement; each adds digits, and a system that needs more is almost singular
MAX_PASSES = 12
NEGLIGIBLE_CORRECTION = 2.0**-54  # a correction this small, relative to its segment, is lost in float64
MAX_LAST_CORRECTION = 1e-6  # relative to its segment: a larger last correction means no convergence


@dataclass(frozen=True, eq=False)
class KnotConditions:
    """The conditions on derivatives 0..2s-1 at every knot, for components with the same fixed derivatives.

    The masks have shape (n + 1, 2s). A fixed derivative takes its value on each existing side of the knot. A
    continuous derivative is equal on both sides; at an end of the course the missing side counts as zero.
    """

    durations: Array  # [s], (n,)
    fixed: Mask
    continuous: Mask

    def solve(self, values: Array) -> Array:
        """Return coefficients (n, 2s, m) of m components.

        `values` (n + 1, s, m) are zero where no derivative is fixed. SpecError is raised where the system is
        singular to float64 precision.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            back_substituted = self._factorized()
            targets = self._targets(values)
            coefficients, error = back_substituted(targets).astype(np.longdouble), 1.0
            for _ in range(MAX_PASSES):
                step = back_substituted(targets - self._met(coefficients))
                coefficients += step
                before, error = error, _relative_size(step, coefficients.astype(float))
                # errors shrink by a constant ratio, so the next error is known without another pass
                if error * (error / before) <= NEGLIGIBLE_CORRECTION or not error <= before / 2:
                    break
        if not error <= MAX_LAST_CORRECTION:
            raise SpecError(self._too_hard())
        return np.asarray(coefficients, dtype=float)

    @cached_property
    def _unit(self) -> np.longdouble:
        """The unit of time u [s], the geometric mean of the durations."""
        return np.longdouble(np.exp(np.log(self.durations).mean()))

    @cached_property
    def _rates(self) -> Extended:
        """(u/T)^d of every segment, (n, 2s)."""
        return np.vander(self._unit / self.durations, self.fixed.shape[1], increasing=True)

    @cached_property
    def _rows(self) -> Mask:
        """Masks of the conditions: (n + 1, 2s, 2), on a segment's end, then on a segment's beginning.

        Continuity counts as a condition on the end. In this order rows stay within s places above the
        diagonal and 2s - 1 below.
        """
        ends = self.fixed | self.continuous
        begins = self.fixed.copy()
        begins[0] = ends[0]
        begins[-1] = ends[0] = False
        return np.stack([ends, begins], axis=-1)

    def _met(self, coefficients: Extended) -> Extended:
        """Return the left-hand sides of all rows, (rows, m)."""
        table = np.zeros((*self._rows.shape, coefficients.shape[-1]), dtype=np.longdouble)
        begins = coefficients * self._rates[..., None]
        table[1:, :, 0] = (_binomials(self._rates.shape[1]) @ coefficients) * self._rates[..., None]
        table[:-1, :, 0] -= np.where(self.continuous[:-1, :, None], begins, 0)
        table[:-1, :, 1] = begins
        return np.asarray(table[self._rows])

    def _targets(self, values: Array) -> Extended:
        """Return the right-hand sides of all rows, (rows, m)."""
        orders = range(values.shape[1])
        scale = np.array([self._unit**order / math.factorial(order) for order in orders])
        table = np.zeros((*self._rows.shape, values.shape[-1]), dtype=np.longdouble)
        table[:, : values.shape[1]] = (values * scale[:, None])[:, :, None]
        return np.asarray(table[self._rows])

    def _factorized(self) -> Callable[[Extended], Array]:
        """Return a function from right-hand sides (rows, m) to coefficients (n, 2s, m), in float64."""
        from scipy.linalg import lapack

        band, lower, upper = self._band()
        factors, pivots, _ = lapack.dgbtrf(band, lower, upper, overwrite_ab=1)

        def back_substituted(sides: Extended) -> Array:
            solution, _ = lapack.dgbtrs(factors, lower, upper, sides.astype(float), pivots)
            return np.ascontiguousarray(solution).reshape(*self._rates.shape, -1)

        return back_substituted

    def _band(self) -> tuple[Array, int, int]:
        """Return the matrix in LAPACK's band storage with room for pivoting, and its two bandwidths."""
        size = self._rates.shape[1]
        row = np.cumsum(self._rows).reshape(self._rows.shape) - 1
        rates = self._rates.astype(float)
        # a row's entry on power d of the segment that begins at its knot; negative for continuity
        (k, d), (k_join, d_join) = self._rows[:-1, :, 1].nonzero(), self.continuous[1:-1].nonzero()
        i = np.concatenate([row[k, d, 1], row[k_join + 1, d_join, 0]])
        j = size * np.concatenate([k, k_join + 1]) + np.concatenate([d, d_join])
        entries = np.concatenate([rates[k, d], -rates[k_join + 1, d_join]])
        # and entries on powers d and above of the segment that ends there
        k, d = self._rows[1:, :, 0].nonzero()
        i_end, first = row[k + 1, d, 0], size * k
        lower = int(max((i_end - first - d).max(), (i - j).max()))
        upper = int(max((first + size - 1 - i_end).max(), (j - i).max()))
        band = np.zeros((len(self.durations) * size, 2 * lower + upper + 1))
        band[j, lower + upper + i - j] = entries
        powers, along = np.arange(size), band.shape[1] - 1
        places = (lower + upper + i_end + along * first)[:, None] + along * powers
        present = powers >= d[:, None]
        band.ravel()[places[present]] = (_binomials(size)[d] * rates[k, d, None])[present]
        return band.T, lower, upper

    def _too_hard(self) -> str:
        shortest, longest = self.durations.min(), self.durations.max()
        return (
            "fixed and durations make conditions that float64 cannot tell apart; make the durations, "
            f"{shortest:.3g} to {longest:.3g} s, more alike, or give other derivatives"
        )


@cache
def _binomials(size: int) -> Array:
    """Return C(j, d) in row d and column j."""
    return frozen([[math.comb(j, d) for j in range(size)] for d in range(size)], "binomials")


def _relative_size(step: Array, coefficients: Array) -> float:
    """Return the largest step relative to the largest coefficient of its segment and component.

    Both arrays have shape (n, 2s, m). A component that is almost constant zero in one segment is measured by
    float64's rounding of its other segments.
    """
    sizes = np.abs(coefficients).max(axis=1)
    floor = np.finfo(float).eps * sizes.max(axis=0)
    return float((np.abs(step).max(axis=1) / np.maximum(sizes + floor, np.finfo(float).tiny)).max())
