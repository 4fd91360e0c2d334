"""Subdivision of a trajectory into pieces on which the interpolation error is negligible."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.certification import quantities
from aerobat.certification.enclosure.interpolation_error import (
    MAX_COMMAND_REMAINDER,
    MAX_REMAINDER,
    regular,
)
from aerobat.certification.thrust_curve import MIN_DURATION, ThrustCurve
from aerobat.states import TimeInterval
from aerobat.trajectory.subintervals import Subintervals

MAX_PIECES = 20_000  # limit of the pieces at a time, besides four a segment; no known flight needs as many


@dataclass(frozen=True)
class Subdivision:
    """The pieces of a curve in order, and the intervals that are left out."""

    pieces: Subintervals
    vanishing: tuple[TimeInterval, ...]  # where |f| is below the floor


def subdivide(curve: ThrustCurve) -> Subdivision:
    """Halve segments until |f| is above the curve's floor and interpolation is accurate on each piece.

    Pieces below the floor, or too close to it to decide, are left out.
    """
    count = curve.trajectory.segments
    pending = Subintervals.whole(count)
    done, excluded = [pending[:0]], [pending[:0]]
    while len(pending):
        norms = curve.norms(curve.series(curve.on(pending)), pending)
        mean = norms[:, 0, 1]
        spread = norms[:, 1:, 1].sum(axis=1)
        good = (mean - spread >= curve.floor) & regular(norms)
        good[good] = _accurate(curve, pending[good], norms[good])
        hopeless = (mean + spread < curve.floor) | (pending.seconds(curve.trajectory) < MIN_DURATION)
        hopeless |= len(good) > MAX_PIECES + 4 * count
        done.append(pending[good])
        excluded.append(pending[hopeless & ~good])
        pending = pending[~(good | hopeless)].halves()
    pieces, rest = (Subintervals.joined(parts).in_order() for parts in (done, excluded))
    return Subdivision(pieces, _time_intervals(curve, rest))


def _accurate(curve: ThrustCurve, pieces: Subintervals, norms: Array) -> NDArray[np.bool_]:
    found = curve.error_bounds(norms, pieces)
    allowed = MAX_REMAINDER * np.maximum(quantities.scales(curve.vehicle), found.magnitude)
    small = (found.remainder <= allowed).all(axis=1)
    lags = curve.vehicle.lags
    rates = lags * found.rate_remainder[:, : len(lags)]
    small &= (rates <= MAX_COMMAND_REMAINDER / MAX_REMAINDER * allowed[:, : len(lags)]).all(axis=1)
    return np.asarray(small & np.isfinite(found.magnitude).all(axis=1))


def _time_intervals(curve: ThrustCurve, pieces: Subintervals) -> tuple[TimeInterval, ...]:
    """Return the intervals covered by consecutive pieces."""
    if not len(pieces):
        return ()
    start, end = pieces.spans(curve.trajectory)
    apart = start[1:] - end[:-1] > MIN_DURATION
    firsts = start[np.append(True, apart)]
    lasts = end[np.append(apart, True)]
    return tuple(TimeInterval(float(a), float(b)) for a, b in zip(firsts, lasts, strict=True))
