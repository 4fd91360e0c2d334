"""Speed and derivatives per axis: polynomials, so that interpolation is exact but for rounding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerobat.arrays import AXES, Array
from aerobat.certification.certificate import Finding, Side
from aerobat.certification.enclosure import chebyshev
from aerobat.certification.enclosure.queries import ChebyshevSeries, ExtremumQuery, both_sides, root
from aerobat.certification.envelope import Envelope
from aerobat.problem.problem import DERIVATIVES, UNITS, Limits
from aerobat.trajectory import Trajectory, polynomial
from aerobat.trajectory.subintervals import Subintervals

# of the limit or of the derivative's largest component, the larger: a plan may run along such a limit or end
# on it, so beyond by so much counts as met
LIMIT_TOLERANCE = 1e-9
KINEMATIC_TIGHTNESS = LIMIT_TOLERANCE / 10  # of enclosures


def kinematic_findings(trajectory: Trajectory, envelope: Envelope) -> list[Finding]:
    """The largest speed, and the extrema of every component that `envelope.limits` bounds."""
    components = _limited(envelope.limits)
    basis = chebyshev.basis(max(2 * (trajectory.degree - 1), trajectory.degree, 1))
    s = (1 + basis.nodes) / 2
    derivatives = [trajectory.on_segments(s, k) for k in range(len(DERIVATIVES))]
    columns = [np.sum(derivatives[1] ** 2, axis=-1), *(derivatives[k][..., axis] for k, axis in components)]
    series = basis.analysis @ np.stack(columns, axis=-1)
    magnitude = np.abs(series).sum(axis=1)
    off = [chebyshev.EVALUATION_ROUNDING * _sums(trajectory, k)[:, axis] for k, axis in components]
    off_speed = chebyshev.EVALUATION_ROUNDING * np.linalg.norm(_sums(trajectory, 1), axis=1)
    errors = [(2 * np.sqrt(magnitude[:, 0]) + off_speed) * off_speed, *off]
    error = basis.lebesgue * np.stack(errors, axis=-1)
    whole = Subintervals.whole(trajectory.segments)
    found = ChebyshevSeries(
        trajectory, whole, series, error, magnitude.max(axis=0), KINEMATIC_TIGHTNESS, everywhere=True
    )
    largest = [float(np.abs(values).max()) for values in derivatives]
    return found.answers(_queries(envelope, components, largest))


def _limited(limits: Limits) -> list[tuple[int, int]]:
    """Every derivative and axis with a limit."""
    bounds = [np.isfinite(limits.of(k)).any(axis=0) for k in range(len(DERIVATIVES))]
    return [(int(k), int(axis)) for k, axis in np.argwhere(bounds)]


def _queries(
    envelope: Envelope, components: list[tuple[int, int]], largest: list[float]
) -> list[ExtremumQuery]:
    """Queries of speed and of the components, given the `largest` component of each derivative."""
    queries = [_lenient(ExtremumQuery("speed", "m/s", Side.MAX, envelope.speed, 0, 1, root), largest[1])]
    for column, (k, axis) in enumerate(components, 1):
        lower, upper = envelope.limits.of(k)
        sides = both_sides(f"{DERIVATIVES[k]} {AXES[axis]}", UNITS[k], column, lower[axis], upper[axis])
        queries += [_lenient(side, largest[k]) for side in sides]
    return queries


def _lenient(query: ExtremumQuery, largest: float) -> ExtremumQuery:
    return replace(query, slack=LIMIT_TOLERANCE * max(largest, abs(query.limit)))


def _sums(trajectory: Trajectory, derivative: int) -> Array:
    """The sums of absolute values that each component is evaluated from, (S, 3)."""
    coefficients = polynomial.differentiate(trajectory.coefficients, derivative)
    return np.asarray(np.abs(coefficients).sum(axis=1) / trajectory.durations[:, None] ** derivative)
