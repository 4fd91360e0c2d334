"""A few steps of the dual active-set method, for many additions to one solved problem at once."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization.assignment import Indices, Mask

_STEPS = 3  # more hardly raise the bounds
_TINY = 1e-300


@dataclass(frozen=True, eq=False, slots=True)
class Ascent:
    """Additions on their way up: pushed by t, one raises the dual objective by slope · t − ½ curvature · t².

    Meanwhile the multipliers of the w active rows fall by give · t.
    """

    give: Array  # (w, q)
    slope: Array  # (q,)
    curvature: Array  # (q,) positive


def dual_steps(
    inverse: Array, multipliers: Array, equal: Mask, ascent: Ascent
) -> tuple[Array, Array, Indices]:
    """Multipliers of the active rows for each addition, (w, q), how far it is pushed, (q,), which fall short.

    A step ends at the top, or where a multiplier is zero; its row is then dropped and the next step goes on
    without it (Goldfarb and Idnani 1983). `inverse` (w, w) is that of the active rows' Gram matrix; rows that
    are `equal`ities have multipliers of either sign and never drop.
    """
    left = np.where(equal, inf, multipliers)[:, None]  # to fall, until the row drops
    pushed, stopped = _step(left, ascent)
    held = multipliers[:, None] - pushed * ascent.give
    if not stopped.size:
        return held, pushed, stopped
    moving, step, dropped = np.arange(len(pushed)), pushed, list[tuple[Array, Indices]]()
    for _ in range(_STEPS - 1):
        rate = (ascent.give / left)[:, stopped]
        left = (left - step * ascent.give)[:, stopped]
        moving, row, each = moving[stopped], rate.argmax(axis=0), np.arange(len(stopped))
        left[row, each] = inf
        left[left == 0.0] = inf  # a tie: the sign is mended below
        dropped = [(column[:, stopped], earlier[stopped]) for column, earlier in dropped]
        ascent = _without(inverse, row, dropped, _further(ascent, stopped, step))
        step, stopped = _step(left, ascent)
        held[:, moving] -= step * ascent.give
        pushed[moving] += step
        if not stopped.size:
            break
    still = moving[stopped]
    sign = np.where(equal, 0.0, np.sign(multipliers))[:, None]
    return np.where(held * sign < 0.0, 0.0, held), pushed, still


def _step(left: Array, ascent: Ascent) -> tuple[Array, Indices]:
    """How far each addition goes, and which of them a multiplier stops."""
    top = ascent.slope / ascent.curvature
    soonest = (ascent.give / left).max(axis=0, initial=_TINY)
    step = np.minimum(top, 1.0 / soonest)
    return step, (step < top).nonzero()[0]


def _further(ascent: Ascent, some: Indices, step: Array) -> Ascent:
    """Some of the additions after a step."""
    slope = (ascent.slope - step * ascent.curvature)[some]
    return Ascent(ascent.give[:, some], slope, ascent.curvature[some])


def _without(inverse: Array, row: Indices, dropped: list[tuple[Array, Indices]], ascent: Ascent) -> Ascent:
    """The ascent once `row` is dropped, beside those `dropped` before, to which it is added.

    Each dropped row goes with its column of the inverse, less what the earlier ones took of it.
    """
    each = np.arange(len(row))
    column = inverse[:, row]
    for taken, earlier in dropped:
        column = column - taken * (taken[row, each] / taken[earlier, each])
    dropped.append((column, row))
    pivot, given = np.maximum(column[row, each], _TINY), ascent.give[row, each]
    give = ascent.give - column * (given / pivot)
    give[row, each] = 0.0
    return Ascent(give, ascent.slope, ascent.curvature + given**2 / pivot)
