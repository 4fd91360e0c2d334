"""Speed, derivatives per axis, conditions: polynomials, so that interpolation is exact but for rounding."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerobat.arrays import AXES, Array
from aerobat.certification.certificate import Finding, Side
from aerobat.certification.enclosure import chebyshev
from aerobat.certification.enclosure.queries import ChebyshevSeries, ExtremumQuery, both_sides, root
from aerobat.certification.envelope import Envelope
from aerobat.problem.condition import Condition, ForceBalance, Quantity
from aerobat.problem.problem import DERIVATIVES, UNITS, Limits
from aerobat.trajectory import Trajectory, polynomial
from aerobat.trajectory.subintervals import Subintervals

# of the limit or of the largest value of what it limits, the larger: a plan may run along such a limit or end
# on it, so beyond by so much counts as met
LIMIT_TOLERANCE = 1e-9
KINEMATIC_TIGHTNESS = LIMIT_TOLERANCE / 10  # of enclosures


@dataclass(frozen=True)
class PolynomialCurve:
    """Position and its derivatives at Chebyshev nodes, as many as polynomials of twice their degree need."""

    trajectory: Trajectory
    basis: chebyshev.Basis
    derivatives: Array  # position to crackle, (S, N, 6, 3)
    sums: Array  # of the absolute values that they are evaluated from, (S, 6, 3)

    @classmethod
    def of(cls, trajectory: Trajectory) -> PolynomialCurve:
        """The curve of a trajectory."""
        basis = chebyshev.basis(max(2 * (trajectory.degree - 1), trajectory.degree, 1))
        s = (1 + basis.nodes) / 2
        orders = range(len(DERIVATIVES))
        derivatives = np.stack([trajectory.on_segments(s, k) for k in orders], axis=-2)
        return cls(trajectory, basis, derivatives, np.stack([_sums(trajectory, k) for k in orders], axis=1))

    def series(self, columns: list[PolynomialColumn]) -> ChebyshevSeries:
        """What the columns hold, as series with their errors."""
        series = self.basis.analysis @ np.stack([column.values for column in columns], axis=-1)
        error = self.basis.lebesgue * np.stack([column.error for column in columns], axis=-1)
        whole = Subintervals.whole(self.trajectory.segments)
        scale = np.abs(series).sum(axis=1).max(axis=0)
        return ChebyshevSeries(
            self.trajectory, whole, series, error, scale, KINEMATIC_TIGHTNESS, everywhere=True
        )


@dataclass(frozen=True)
class PolynomialColumn:
    """A polynomial on each segment, at the nodes, and what is wanted to be known of it."""

    values: Array  # (S, N)
    error: Array  # of the values, by rounding, at most, (S,)
    queries: list[ExtremumQuery]  # whichever column they name


def kinematic_findings(trajectory: Trajectory, envelope: Envelope, balance: ForceBalance) -> list[Finding]:
    """The largest speed, and the extrema of all that `envelope.limits` and `envelope.conditions` bound."""
    curve = PolynomialCurve.of(trajectory)
    columns = [_speed(curve, envelope.speed), *_components(curve, envelope.limits)]
    columns += [_bounded(curve, condition, balance) for condition in envelope.conditions]
    queries = [
        replace(query, column=place) for place, column in enumerate(columns) for query in column.queries
    ]
    return curve.series(columns).answers(queries)


def _speed(curve: PolynomialCurve, limit: float) -> PolynomialColumn:
    """|v|², asked for |v|."""
    velocity = curve.derivatives[:, :, 1]
    squared = np.sum(velocity**2, axis=-1)
    off = chebyshev.EVALUATION_ROUNDING * np.linalg.norm(curve.sums[:, 1], axis=1)
    magnitude = np.abs(curve.basis.analysis @ squared[..., None]).sum(axis=(1, 2))
    query = ExtremumQuery("speed", "m/s", Side.MAX, limit, 0, 1, root)
    lenient = _lenient(query, float(np.abs(velocity).max()))
    return PolynomialColumn(squared, (2 * np.sqrt(magnitude) + off) * off, [lenient])


def _components(curve: PolynomialCurve, limits: Limits) -> list[PolynomialColumn]:
    """Every derivative and axis with a limit."""
    columns = []
    for k, name in enumerate(DERIVATIVES):
        lower, upper = limits.of(k)
        values = curve.derivatives[:, :, k]
        for axis in np.flatnonzero(np.isfinite(lower) | np.isfinite(upper)):
            sides = both_sides(f"{name} {AXES[axis]}", UNITS[k], 0, lower[axis], upper[axis])
            error = chebyshev.EVALUATION_ROUNDING * curve.sums[:, k, axis]
            queries = [_lenient(side, float(np.abs(values).max())) for side in sides]
            columns.append(PolynomialColumn(values[..., axis], error, queries))
    return columns


def _bounded(curve: PolynomialCurve, condition: Condition, balance: ForceBalance) -> PolynomialColumn:
    """What a condition bounds, asked on the sides where it does."""
    bound = condition.bound(balance)
    state = curve.derivatives[:, :, :3]
    summed = np.sum(np.abs(bound.weights) * curve.sums[:, :3], axis=(1, 2)) + abs(bound.constant)
    quantity, unit = condition.quantity, UNITS[condition.quantity.derivative]
    vectors = state[:, :, quantity.derivative]
    if quantity is Quantity.SPECIFIC_THRUST:
        vectors = balance.specific_thrust(state[:, :, 1], vectors)
    largest = float(np.abs(vectors).max() * np.linalg.norm(condition.direction))
    sides = both_sides(condition.name, unit, 0, condition.lower, condition.upper)
    queries = [_lenient(side, largest) for side in sides if np.isfinite(side.limit)]
    return PolynomialColumn(bound.value(state), chebyshev.EVALUATION_ROUNDING * summed, queries)


def _lenient(query: ExtremumQuery, largest: float) -> ExtremumQuery:
    return replace(query, slack=LIMIT_TOLERANCE * max(largest, abs(query.limit)))


def _sums(trajectory: Trajectory, derivative: int) -> Array:
    """The sums of absolute values that each component is evaluated from, (S, 3)."""
    coefficients = polynomial.differentiate(trajectory.coefficients, derivative)
    return np.asarray(np.abs(coefficients).sum(axis=1) / trajectory.durations[:, None] ** derivative)
