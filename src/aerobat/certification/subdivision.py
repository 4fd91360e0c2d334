"""Cutting a trajectory into pieces on which interpolation is provably as good as exact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.certification import quantities
from aerobat.certification.enclosure import interpolation_error
from aerobat.certification.thrust_curve import Pieces, ThrustCurve, joined
from aerobat.flatness import TimeInterval

REMAINDER = 1e-8  # of its scale: what interpolation may leave open of a quantity
TWIST = 1e-9  # [rad] and of the frame's angle on one piece
SHORTEST = 1e-8  # [s], a piece that is not cut further
MANY = 20_000  # pieces at a time, beside the segments; no flight needs so many


@dataclass(frozen=True)
class Resolution:
    """The pieces of a curve in their order, and what is left of it."""

    pieces: Pieces
    vanishing: tuple[TimeInterval, ...]  # where |f| is below the floor


def resolve(curve: ThrustCurve, floor: float) -> Resolution:
    """Halve segments until |f| >= floor [m/s²] and interpolation is accurate on each piece.

    What stays below the floor, or cannot be told from it, is left out.
    """
    count = curve.trajectory.segments
    pending = Pieces(np.arange(count), np.zeros(count), np.ones(count))
    done, left = [pending[:0]], [pending[:0]]
    while len(pending.segment):
        norms = curve.norms(curve.series(curve.on(pending)), pending)
        mean, spread = norms[:, 0, 1], norms[:, 1:, 1].sum(axis=1)
        good = (mean - spread >= floor) & interpolation_error.regular(norms)
        good[good] = _accurate(curve, pending[good], norms[good])
        hopeless = (mean + spread < floor) | (pending.seconds(curve.trajectory) < SHORTEST)
        hopeless |= len(good) > MANY + 4 * count
        done.append(pending[good])
        left.append(pending[hopeless & ~good])
        pending = pending[~(good | hopeless)].halves()
    return Resolution(_sorted(joined(done)), _spans(curve, _sorted(joined(left))))


def _accurate(curve: ThrustCurve, pieces: Pieces, norms: Array) -> NDArray[np.bool_]:
    seconds = pieces.seconds(curve.trajectory)
    found = interpolation_error.accuracy(norms, seconds, curve.sums[pieces.segment], curve.vehicle)
    wanted = REMAINDER * np.maximum(quantities.scales(curve.vehicle), found.size)
    small = (found.remainder <= wanted).all(axis=1) & (found.twist_remainder <= TWIST)
    return np.asarray(small & np.isfinite(found.size).all(axis=1))


def _sorted(pieces: Pieces) -> Pieces:
    return pieces[np.lexsort((pieces.start, pieces.segment))]


def _spans(curve: ThrustCurve, pieces: Pieces) -> tuple[TimeInterval, ...]:
    """The stretches that pieces in order make up together."""
    if not len(pieces.segment):
        return ()
    start, end = (pieces.times(curve.trajectory, np.full(len(pieces.segment), side)) for side in (-1.0, 1.0))
    apart = start[1:] - end[:-1] > SHORTEST
    firsts, lasts = start[np.append(True, apart)], end[np.append(apart, True)]
    return tuple(TimeInterval(float(first), float(last)) for first, last in zip(firsts, lasts, strict=True))
