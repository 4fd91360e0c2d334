"""Speed and derivatives per axis: polynomials, so that interpolation is exact but for rounding.

A plan may run along such a limit or end on it, so one that is met exactly holds: LIMIT_TOLERANCE says what "exactly"
leaves to rounding.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerobat.arrays import Array
from aerobat.certification.certificate import Finding, Side
from aerobat.certification.enclosure import chebyshev
from aerobat.certification.enclosure.queries import ChebyshevSeries, ExtremumQuery, both_sides, root
from aerobat.certification.envelope import Envelope
from aerobat.certification.thrust_curve import Pieces
from aerobat.problem.problem import DERIVATIVES, UNITS, Limits
from aerobat.trajectory import Trajectory, polynomial

AXES = "xyz"
LIMIT_TOLERANCE = (
    1e-9  # of the limit or of the derivative's largest component, the larger: beyond by so much is met
)
TIGHTNESS = LIMIT_TOLERANCE / 10  # of enclosures


def kinematic_findings(trajectory: Trajectory, envelope: Envelope) -> list[Finding]:
    """The largest speed, and the extremes of every component that `envelope.limits` bounds."""
    count, components = trajectory.segments, _limited(envelope.limits)
    basis = chebyshev.basis(max(2 * (trajectory.degree - 1), trajectory.degree, 1))
    s = (1 + basis.nodes) / 2
    rates = [trajectory.on_segments(s, k) for k in range(len(DERIVATIVES))]
    columns = [np.sum(rates[1] ** 2, axis=-1), *(rates[k][..., axis] for k, axis in components)]
    series = basis.analysis @ np.stack(columns, axis=-1)
    most = np.abs(series).sum(axis=1)
    off = [chebyshev.ROUNDING * _sums(trajectory, k)[:, axis] for k, axis in components]
    off_speed = chebyshev.ROUNDING * np.linalg.norm(_sums(trajectory, 1), axis=1)
    errors = [(2 * np.sqrt(most[:, 0]) + off_speed) * off_speed, *off]
    whole = Pieces(np.arange(count), np.zeros(count), np.ones(count))
    error = basis.lebesgue * np.stack(errors, axis=-1)
    found = ChebyshevSeries(trajectory, whole, series, error, most.max(axis=0), TIGHTNESS, everywhere=True)
    return found.answers(_questions(envelope, components, [float(np.abs(rate).max()) for rate in rates]))


def _limited(limits: Limits) -> list[tuple[int, int]]:
    """Every derivative and axis with a limit."""
    bounds = [np.isfinite(limits.of(k)).any(axis=0) for k in range(len(DERIVATIVES))]
    return [(int(k), int(axis)) for k, axis in np.argwhere(bounds)]


def _questions(
    envelope: Envelope, components: list[tuple[int, int]], largest: list[float]
) -> list[ExtremumQuery]:
    """What is asked of speed and of the components, given the `largest` component of each derivative."""
    asked = [_lenient(ExtremumQuery("speed", "m/s", Side.MAX, envelope.speed, 0, 1, root), largest[1])]
    for column, (k, axis) in enumerate(components, 1):
        title, (lower, upper) = f"{DERIVATIVES[k]} {AXES[axis]}", envelope.limits.of(k)
        sides = both_sides(title, UNITS[k], column, lower[axis], upper[axis])
        asked += [_lenient(side, largest[k]) for side in sides]
    return asked


def _lenient(question: ExtremumQuery, largest: float) -> ExtremumQuery:
    return replace(question, slack=LIMIT_TOLERANCE * max(largest, abs(question.limit)))


def _sums(trajectory: Trajectory, derivative: int) -> Array:
    """The sums of absolute values that each component is evaluated from, (S, 3)."""
    rates = polynomial.differentiate(trajectory.coefficients, derivative)
    return np.asarray(np.abs(rates).sum(axis=1) / trajectory.durations[:, None] ** derivative)
