"""Enclosures of the maxima of Chebyshev series, by branch and bound with interval halving.

On an interval a series is at most the maximum of its first three terms, a parabola, plus the magnitudes of
all other terms. Halving the interval divides these magnitudes by eight. Intervals whose bound is below a
known value are pruned.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerobat.arrays import Array, Indices
from aerobat.certification.enclosure import chebyshev
from aerobat.trajectory.subintervals import Subintervals

MAX_HALVINGS = 50
MAX_OPEN = 50_000  # limit of the open intervals besides the initial ones; no known flight needs a tenth of it


@dataclass(frozen=True)
class SeriesBatch:
    """Series that approximate functions. Each belongs to one of G groups whose maximum is wanted.

    The width of an enclosure, without errors, is at most `tightness` times the group's scale or its maximum,
    whichever is larger. It is wider where that takes too many intervals.
    """

    coefficients: Array  # (N, K + 1)
    error: Array  # largest difference between function and series, (N,)
    group: Indices  # (N,)
    scale: Array  # a large value for a group, (G,)
    tightness: float


@dataclass(frozen=True)
class Enclosure:
    """For each group: min <= sup <= max, and the point at which `min` is reached. All (G,)."""

    min: Array
    max: Array
    member: Indices
    position: Array  # in [-1, 1], on that member's interval


def enclose_maximum(batch: SeriesBatch) -> Enclosure:
    """Return an enclosure of the maximum of each group, all groups at once."""
    groups = len(batch.scale)
    found = Enclosure(
        np.full(groups, -np.inf), np.full(groups, -np.inf), np.zeros(groups, dtype=np.intp), np.zeros(groups)
    )
    halves = chebyshev.basis(batch.coefficients.shape[1] - 1).halves
    slack = batch.tightness / 10 * batch.scale
    pending, coefficients = Subintervals.whole(len(batch.group)), batch.coefficients
    for halving in range(MAX_HALVINGS):
        group, error = batch.group[pending.interval], batch.error[pending.interval]
        peak, tail, vertex = parabola_maximum(coefficients, slack[group])
        upper = peak + tail + error
        value = chebyshev.evaluate(coefficients, vertex) - error
        _improve(found, pending, group, vertex, value, slack)
        tolerance = batch.tightness * np.maximum(batch.scale, np.abs(found.min))[group]
        open_ = (upper > found.min[group] + tolerance) & (tail > tolerance / 4)
        if halving == MAX_HALVINGS - 1 or open_.sum() > MAX_OPEN + len(batch.group):
            open_[:] = False  # their bounds are valid, but may not be tight
        np.maximum.at(found.max, group[~open_], upper[~open_])
        if not open_.any():
            break
        rows = np.flatnonzero(open_)
        pending, coefficients = pending[rows].halves(), coefficients[rows]
        coefficients = np.concatenate([coefficients @ half.T for half in halves])
    return found


def parabola_maximum(coefficients: Array, flat: Array | float = 0.0) -> tuple[Array, Array, Array]:
    """Return the maximum of c0 T0 + c1 T1 + c2 T2 on [-1, 1], the sum of all other magnitudes, and its place.

    The place is -1 where these terms change by less than `flat` (n,).
    """
    padded = coefficients if coefficients.shape[1] > 2 else np.pad(coefficients, ((0, 0), (0, 2)))
    c0, c1, c2 = padded[:, :3].T
    inside = (c2 < 0) & (np.abs(c1) < -4 * c2)
    steep = np.where(inside, c2, -1.0)
    vertex = np.where(inside, -c1 / (4 * steep), np.where(c1 < 0, -1.0, 1.0))
    peak = np.where(inside, c0 - steep - c1**2 / (8 * steep), c0 + c2 + np.abs(c1))
    vertex = np.where(np.abs(c1) + np.abs(c2) < flat / 2, -1.0, vertex)
    return peak, np.abs(padded[:, 3:]).sum(axis=1), vertex


def _improve(
    found: Enclosure, parts: Subintervals, group: Indices, vertex: Array, value: Array, slack: Array
) -> None:
    """Update maxima that rise by more than a `slack` (G,); of equal values take the earliest."""
    maximum = found.min.copy()
    np.maximum.at(maximum, group, value)
    position = 2 * parts.start + parts.length * (1 + vertex) - 1
    better = (maximum > found.min + slack)[group] & (value >= maximum[group] - slack[group])
    order = np.lexsort((-position, -parts.interval))  # the last assignment to a group wins
    order = order[better[order]]
    at = group[order]
    found.min[at], found.member[at], found.position[at] = value[order], parts.interval[order], position[order]
