"""Extrema of Chebyshev series on pieces of a trajectory, and the resulting findings about limits."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from operator import neg

import numpy as np

from aerobat.arrays import Array
from aerobat.certification.certificate import Finding, Side, Verdict
from aerobat.certification.enclosure.extrema import SeriesBatch, enclose_maximum
from aerobat.limits.limit import Limit
from aerobat.trajectory import Trajectory
from aerobat.trajectory.subintervals import Subintervals

TIGHTNESS = 1e-7  # of a rotor's range: largest distance between the proven bounds and the values reached
# of the magnitudes of a series' terms: rounding of some ten halvings, and of the sum
SUMMATION_ROUNDING = 1e-13


@dataclass(frozen=True)
class ExtremumQuery:
    """A query for the maximum (minimum if the sign is -1) of a function given by series on pieces."""

    quantity: str
    unit: str
    side: Side
    limit: float  # infinite without a limit
    column: int  # of the series
    sign: int
    # converts the maximum of sign times function to the quantity that people read
    read: Callable[[float], float]
    slack: float = 0.0  # violation that still counts as met
    source: Limit | None = None  # the limit that sets this bound

    def finding(self, reached: float, bound: float, time: float, everywhere: bool) -> Finding:
        """Return the finding for a proven enclosure of the maximum.

        Args:
            reached: A value that the function reaches at `time`.
            bound: An upper bound of the function.
            time: The time of the reached value [s].
            everywhere: Whether the enclosure covers the whole trajectory.
        """
        value, bound = self.read(reached), self.read(bound)
        limit = None if math.isinf(self.limit) else self.limit
        inwards = 1 if self.side is Side.MAX else -1
        verdict = Verdict.UNDECIDED
        if limit is None or (everywhere and inwards * (limit - bound) >= -self.slack):
            verdict = Verdict.HOLDS
        elif inwards * (limit - value) < -self.slack:
            verdict = Verdict.VIOLATED
        found = Finding(self.quantity, self.unit, self.side, value, bound, time, limit, verdict)
        if self.source is None:
            return found
        end, source = self.side is Side.MAX, self.source
        field, room = source.fields[end], source.rooms[end]
        return replace(found, rotor=source.rotor, field=field, size=source.size, room=room)


@dataclass(frozen=True)
class ChebyshevSeries:
    """Functions as Chebyshev series on pieces of a trajectory."""

    trajectory: Trajectory
    pieces: Subintervals
    series: Array  # (P, K + 1, Q)
    error: Array  # largest error of the series, (P, Q)
    scale: Array  # a large value of each function, (Q,)
    tightness: float = TIGHTNESS  # tightness of enclosures, see `SeriesBatch`

    def ends(self) -> Array:
        """Return the values at both ends of the pieces, (P, 2, Q)."""
        alternating = (-1.0) ** np.arange(self.series.shape[1])
        return np.stack([alternating @ self.series, self.series.sum(axis=1)], axis=1)

    def findings(self, queries: Sequence[ExtremumQuery]) -> list[Finding]:
        """Return a finding for each query; none if there are no pieces."""
        count = len(self.pieces)
        if not (count and queries):
            return []
        columns = np.array([query.column for query in queries])
        signed = self.series[..., columns] * np.array([query.sign for query in queries])
        batch = SeriesBatch(
            signed.swapaxes(1, 2).reshape(-1, signed.shape[1]),
            (self.error[:, columns] + SUMMATION_ROUNDING * np.abs(signed).sum(axis=1)).ravel(),
            np.tile(np.arange(len(queries)), count),
            self.scale[columns],
            self.tightness,
        )
        found = enclose_maximum(batch)
        times = self.pieces[found.member // len(queries)].times(self.trajectory, found.position)
        everywhere = not len(self.pieces.rest(self.trajectory.segments))
        ranges = zip(queries, found.min.tolist(), found.max.tolist(), times.tolist(), strict=True)
        return [query.finding(reached, bound, time, everywhere) for query, reached, bound, time in ranges]


def both_sides(quantity: str, unit: str, column: int, lower: float, upper: float) -> list[ExtremumQuery]:
    """Return queries for the minimum and the maximum of a function."""
    return [
        ExtremumQuery(quantity, unit, Side.MIN, float(lower), column, -1, neg),
        ExtremumQuery(quantity, unit, Side.MAX, float(upper), column, 1, float),
    ]


def within(limit: Limit, column: int) -> list[ExtremumQuery]:
    """Return queries for the finite ends of a limit on a function."""
    sides = both_sides(limit.name, limit.unit, column, limit.lower, limit.upper)
    return [replace(side, source=limit) for side in sides if math.isfinite(side.limit)]


def root(value: float) -> float:
    """Return a magnitude, given its square."""
    return math.sqrt(max(value, 0.0))


def angle(value: float) -> float:
    """Return an angle [rad], given the negative of its cosine."""
    return math.acos(min(max(-value, -1.0), 1.0))
