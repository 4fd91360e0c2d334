"""Speed and limits on the path: polynomials, for which interpolation is exact up to rounding."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from aerobat.arrays import Array
from aerobat.certification.certificate import Finding, Side
from aerobat.certification.enclosure import chebyshev
from aerobat.certification.enclosure.queries import ChebyshevSeries, ExtremumQuery, root, within
from aerobat.limits.limit import Limit
from aerobat.problem.limits import DERIVATIVES
from aerobat.trajectory import Trajectory, polynomial
from aerobat.trajectory.subintervals import Subintervals

# accepted violation, relative to the limit or to the largest value of the limited quantity, whichever is
# larger: a plan may follow such a limit or end on it
LIMIT_TOLERANCE = 1e-9
KINEMATIC_TIGHTNESS = LIMIT_TOLERANCE / 10  # tightness of enclosures


@dataclass(frozen=True)
class PolynomialCurve:
    """Position and its derivatives at Chebyshev nodes, enough for polynomials of twice their degree."""

    trajectory: Trajectory
    basis: chebyshev.Basis
    derivatives: Array  # position to crackle, (S, N, 6, 3)
    sums: Array  # sums of the absolute values of their terms, (S, 6, 3)

    @classmethod
    def of(cls, trajectory: Trajectory) -> PolynomialCurve:
        """Return the curve of a trajectory."""
        basis = chebyshev.basis(max(2 * (trajectory.degree - 1), trajectory.degree, 1))
        s = (1 + basis.nodes) / 2
        orders = range(len(DERIVATIVES))
        derivatives = np.stack([trajectory.on_segments(s, k) for k in orders], axis=-2)
        return cls(trajectory, basis, derivatives, np.stack([_sums(trajectory, k) for k in orders], axis=1))

    def series(self, columns: list[PolynomialColumn]) -> ChebyshevSeries:
        """Return the columns as Chebyshev series with their errors."""
        series = self.basis.analysis @ np.stack([column.values for column in columns], axis=-1)
        error = self.basis.lebesgue * np.stack([column.error for column in columns], axis=-1)
        whole = Subintervals.whole(self.trajectory.segments)
        scale = np.abs(series).sum(axis=1).max(axis=0)
        return ChebyshevSeries(self.trajectory, whole, series, error, scale, KINEMATIC_TIGHTNESS)


@dataclass(frozen=True)
class PolynomialColumn:
    """A polynomial on each segment, by its values at the nodes, with queries about it."""

    values: Array  # (S, N)
    error: Array  # largest rounding error of the values, (S,)
    queries: list[ExtremumQuery]


def kinematic_findings(trajectory: Trajectory, speed: float, limits: Iterable[Limit]) -> list[Finding]:
    """Return the findings about the largest speed [m/s] and the extrema of path quantities with limits."""
    curve = PolynomialCurve.of(trajectory)
    columns = [_speed(curve, speed), *(_linear(curve, limit, place) for place, limit in enumerate(limits, 1))]
    return curve.series(columns).findings([query for column in columns for query in column.queries])


def _speed(curve: PolynomialCurve, limit: float) -> PolynomialColumn:
    """Return |v|², with a query for |v|."""
    velocity = curve.derivatives[:, :, 1]
    squared = np.sum(velocity**2, axis=-1)
    off = chebyshev.EVALUATION_ROUNDING * np.linalg.norm(curve.sums[:, 1], axis=1)
    magnitude = np.abs(curve.basis.analysis @ squared[..., None]).sum(axis=(1, 2))
    query = ExtremumQuery("speed", "m/s", Side.MAX, limit, 0, 1, root)
    lenient = _lenient(query, float(np.abs(velocity).max()))
    return PolynomialColumn(squared, (2 * np.sqrt(magnitude) + off) * off, [lenient])


def _linear(curve: PolynomialCurve, limit: Limit, place: int) -> PolynomialColumn:
    """Return the quantity of a limit on the path, as the column at index `place`."""
    quantity = limit.quantity
    values = np.einsum("snka,ka->sn", curve.derivatives, quantity.path) + quantity.constant
    summed = np.sum(np.abs(quantity.path) * curve.sums, axis=(1, 2)) + abs(quantity.constant)
    vectors = np.abs(curve.derivatives).max(axis=(0, 1, 3))
    largest = float(vectors @ np.linalg.norm(quantity.path, axis=1)) + abs(quantity.constant)
    queries = [_lenient(side, largest) for side in within(limit, place)]
    return PolynomialColumn(values, chebyshev.EVALUATION_ROUNDING * summed, queries)


def _lenient(query: ExtremumQuery, largest: float) -> ExtremumQuery:
    return replace(query, slack=LIMIT_TOLERANCE * max(largest, abs(query.limit)))


def _sums(trajectory: Trajectory, derivative: int) -> Array:
    """Return the sums of absolute values of the terms of each component, (S, 3)."""
    coefficients = polynomial.differentiate(trajectory.coefficients, derivative)
    return np.asarray(np.abs(coefficients).sum(axis=1) / trajectory.durations[:, None] ** derivative)
