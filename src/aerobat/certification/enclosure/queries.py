"""Extrema of Chebyshev series on pieces of a trajectory, and what they say of limits: findings."""

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

TIGHTNESS = 1e-7  # of a rotor's range: how near the proven bounds are to what is reached
SUMMATION_ROUNDING = 1e-13  # of the magnitudes of a series' terms: halving it some ten times, and summing


@dataclass(frozen=True)
class ExtremumQuery:
    """A question for the maximum (with the sign -1, the minimum) of a function given by series on pieces."""

    quantity: str
    unit: str
    side: Side
    limit: float  # infinite where there is none
    column: int  # of the series
    sign: int
    read: Callable[[float], float]  # from the greatest value of sign times function to what people read
    slack: float = 0.0  # beyond the limit by so much it counts as met
    source: Limit | None = None  # what the limit is an end of

    def answer(self, reached: float, bound: float, time: float, everywhere: bool) -> Finding:
        """The finding for a proven enclosure of the greatest value.

        Args:
            reached: The function is at least so large at `time`.
            bound: The function is nowhere larger.
            time: [s].
            everywhere: No time was left out.
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
    error: Array  # at most, (P, Q)
    scale: Array  # what is large, (Q,)
    everywhere: bool  # whether the pieces make up the whole trajectory
    tightness: float = TIGHTNESS  # of enclosures, as `SeriesBatch` has it

    def ends(self) -> Array:
        """The values at both ends of the pieces, (P, 2, Q)."""
        alternating = (-1.0) ** np.arange(self.series.shape[1])
        return np.stack([alternating @ self.series, self.series.sum(axis=1)], axis=1)

    def answers(self, queries: Sequence[ExtremumQuery]) -> list[Finding]:
        """A finding for each query; none at all if there are no pieces."""
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
        ranges = zip(queries, found.min.tolist(), found.max.tolist(), times.tolist(), strict=True)
        return [query.answer(reached, bound, time, self.everywhere) for query, reached, bound, time in ranges]


def both_sides(quantity: str, unit: str, column: int, lower: float, upper: float) -> list[ExtremumQuery]:
    """Queries for the minimum and the maximum of a function."""
    return [
        ExtremumQuery(quantity, unit, Side.MIN, float(lower), column, -1, neg),
        ExtremumQuery(quantity, unit, Side.MAX, float(upper), column, 1, float),
    ]


def within(limit: Limit, column: int) -> list[ExtremumQuery]:
    """Queries about the ends that a limit has, of a function."""
    sides = both_sides(limit.name, limit.unit, column, limit.lower, limit.upper)
    return [replace(side, source=limit) for side in sides if math.isfinite(side.limit)]


def root(value: float) -> float:
    """A magnitude, read from its square."""
    return math.sqrt(max(value, 0.0))


def angle(value: float) -> float:
    """An angle [rad], read from the negative of its cosine."""
    return math.acos(min(max(-value, -1.0), 1.0))
