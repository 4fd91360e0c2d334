"""Subdivision of a trajectory into pieces on which the interpolation error is negligible."""

from __future__ import annotations

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
from aerobat.trajectory import Trajectory
from aerobat.trajectory.subintervals import Subintervals

MAX_PIECES = 20_000  # limit of the pieces at a time, besides four a segment; no known flight needs as many


def subdivide(curve: ThrustCurve) -> Subintervals:
    """Halve segments until |f| is above the curve's floor and interpolation is accurate; return the pieces.

    Pieces below the floor, or too close to it to decide, are left out.
    """
    count = curve.trajectory.segments
    pending, done = Subintervals.whole(count), [Subintervals.whole(0)]
    while len(pending):
        norms = curve.norms(curve.series(curve.on(pending)), pending)
        mean = norms[:, 0, 1]
        spread = norms[:, 1:, 1].sum(axis=1)
        good = (mean - spread >= curve.floor) & regular(norms)
        good[good] = _accurate(curve, pending[good], norms[good])
        hopeless = (mean + spread < curve.floor) | (pending.seconds(curve.trajectory) < MIN_DURATION)
        hopeless |= len(good) > MAX_PIECES + 4 * count
        done.append(pending[good])
        pending = pending[~(good | hopeless)].halves()
    return Subintervals.joined(done).in_order()


def _accurate(curve: ThrustCurve, pieces: Subintervals, norms: Array) -> NDArray[np.bool_]:
    found = curve.error_bounds(norms, pieces)
    allowed = MAX_REMAINDER * np.maximum(quantities.scales(curve.vehicle), found.magnitude)
    small = (found.remainder <= allowed).all(axis=1)
    lags = curve.vehicle.lags
    rates = lags * found.rate_remainder[:, : len(lags)]
    small &= (rates <= MAX_COMMAND_REMAINDER / MAX_REMAINDER * allowed[:, : len(lags)]).all(axis=1)
    return np.asarray(small & np.isfinite(found.magnitude).all(axis=1))


def vanishing(trajectory: Trajectory, pieces: Subintervals) -> tuple[TimeInterval, ...]:
    """Return the intervals that pieces leave out, where the thrust vanishes."""
    rest = pieces.rest(trajectory.segments)
    if not len(rest):
        return ()
    start, end = rest.spans(trajectory)
    apart = start[1:] - end[:-1] > MIN_DURATION
    firsts = start[np.append(True, apart)]
    lasts = end[np.append(apart, True)]
    return tuple(TimeInterval(float(a), float(b)) for a, b in zip(firsts, lasts, strict=True))
