"""A few steps of the dual active-set method, for many additions to one solved problem at once."""

from __future__ import annotations

import numpy as np

from aerobat.arrays import Array
from aerobat.programs.assignment import Indices, Mask

_STEPS = 3  # more hardly raise the bounds
_TINY = 1e-300


def dual_steps(
    inverse: Array, multipliers: Array, equal: Mask, give: Array, slope: Array, curvature: Array
) -> tuple[Array, Array]:
    """Multipliers of w active rows, (w, P), and how far each of P additions is pushed, (P,).

    Addition p raises the dual objective by slope[p] · t − ½ curvature[p] · t² when it is pushed by t, while
    the multipliers fall by give[:, p] · t. A step ends at the top, or where a multiplier is zero; its row is
    then dropped and the next step goes on without it (Goldfarb and Idnani 1983). `inverse` (w, w) is that of
    the active rows' Gram matrix; rows that are `equal`ities have multipliers of either sign and never drop.
    """
    reached = np.repeat(multipliers[:, None], len(slope), axis=1)
    pushed = np.zeros(len(slope))
    loose = np.repeat(~equal[:, None], len(slope), axis=1)
    dropped: list[tuple[Array, Indices]] = []  # the inverse's columns that left it, row dropped
    moving = np.arange(len(slope))
    for _ in range(_STEPS):
        top = slope / np.maximum(curvature, _TINY)
        soonest, first = _first_to_vanish(reached[:, moving], give, loose[:, moving])
        step = np.minimum(top, 1.0 / np.maximum(soonest, _TINY))
        reached[:, moving] -= step * give
        pushed[moving] += step
        stopped = np.flatnonzero(step < top)
        if not stopped.size:
            break
        slope, curvature = (slope - step * curvature)[stopped], curvature[stopped]
        moving, row, give = moving[stopped], first[stopped], give[:, stopped]
        dropped = [(column[:, stopped], row_[stopped]) for column, row_ in dropped]
        each = np.arange(len(moving))
        column = inverse[:, row]
        for earlier, row_ in dropped:
            column = column - earlier * (earlier[row, each] / earlier[row_, each])
        pivot = np.maximum(column[row, each], _TINY)
        given = give[row, each]
        give = give - column * (given / pivot)
        curvature = curvature + given**2 / pivot
        give[row, each], loose[row, moving] = 0.0, False
        dropped.append((column, row))
    return _feasible(reached, multipliers, equal), pushed


def _first_to_vanish(multipliers: Array, give: Array, loose: Mask) -> tuple[Array, Indices]:
    """For each addition, 1 / (the push at which a first multiplier is zero), 0 for never, and its row."""
    if not len(give):
        return np.zeros(give.shape[1]), np.zeros(give.shape[1], dtype=np.intp)
    rate = np.divide(give, multipliers, out=np.zeros_like(give), where=loose & (multipliers != 0.0))
    row = rate.argmax(axis=0)
    return rate[row, np.arange(len(row))], row


def _feasible(reached: Array, multipliers: Array, equal: Mask) -> Array:
    """Rounding must not turn a multiplier's sign."""
    sign = np.where(equal, 0.0, np.sign(multipliers))[:, None]
    return np.where(reached * sign < 0.0, 0.0, reached)
