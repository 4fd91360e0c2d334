"""A few steps of the dual active-set method, for many candidates of one solved QP at once."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

from aerobat.arrays import Array, Indices, Mask

MIN_DIVISOR = 1e-300  # divisor in place of zero, where the dividend is zero too
_MAX_STEPS = 3  # dual active-set steps; more hardly raise the bounds


@dataclass(frozen=True, eq=False, slots=True)
class DualDirections:
    """Search directions in the space of the multipliers, one for each of q candidates.

    A step t along a direction raises the dual objective by slope · t − ½ curvature · t². The multipliers of
    the w active rows change by −multiplier_rate · t.
    """

    multiplier_rate: Array  # (w, q)
    slope: Array  # (q,)
    curvature: Array  # (q,) positive


def dual_ascent(
    inverse_gram: Array, multipliers: Array, is_equality: Mask, directions: DualDirections
) -> tuple[Array, Array, Indices]:
    """Return the multipliers (w, q) after ascent, the summed steps (q,), and the blocked candidates.

    A step ends at the maximum, or where a multiplier reaches zero. The row of that multiplier is then dropped
    and the next step continues without it [GI]. Candidates are blocked if another step might raise their
    bounds.

    Args:
        inverse_gram: the inverse of the active rows' Gram matrix, (w, w).
        multipliers: multipliers of the active rows at the start, (w,).
        is_equality: mask of the rows that never drop, because their multipliers may have either sign, (w,).
        directions: directions of the candidates.
    """
    # multipliers, infinite once a row is dropped
    remaining = np.where(is_equality, inf, multipliers)[:, None]
    steps, blocked = _step(remaining, directions)
    result = multipliers[:, None] - steps * directions.multiplier_rate
    if not blocked.size:
        return result, steps, blocked
    moving = np.arange(len(steps))
    step = steps
    dropped = list[tuple[Array, Indices]]()
    for _ in range(_MAX_STEPS - 1):
        rate = (directions.multiplier_rate / remaining)[:, blocked]
        remaining = (remaining - step * directions.multiplier_rate)[:, blocked]
        row = rate.argmax(axis=0)
        remaining[row, np.arange(len(blocked))] = inf
        remaining[remaining == 0.0] = inf  # a tie of two rows: the sign is corrected below
        moving = moving[blocked]
        dropped = [(column[:, blocked], earlier[blocked]) for column, earlier in dropped]
        slope = (directions.slope - step * directions.curvature)[blocked]
        directions = DualDirections(
            directions.multiplier_rate[:, blocked], slope, directions.curvature[blocked]
        )
        directions = _without(inverse_gram, row, dropped, directions)
        step, blocked = _step(remaining, directions)
        result[:, moving] -= step * directions.multiplier_rate
        steps[moving] += step
        if not blocked.size:
            break
    sign = np.where(is_equality, 0.0, np.sign(multipliers))[:, None]
    return np.where(result * sign < 0.0, 0.0, result), steps, moving[blocked]


def _step(remaining: Array, directions: DualDirections) -> tuple[Array, Indices]:
    """Return the steps, and the candidates whose steps end where a multiplier reaches zero."""
    to_maximum = directions.slope / directions.curvature
    fastest = (directions.multiplier_rate / remaining).max(axis=0, initial=MIN_DIVISOR)
    step = np.minimum(to_maximum, 1.0 / fastest)
    return step, (step < to_maximum).nonzero()[0]


def _without(
    inverse_gram: Array, row: Indices, dropped: list[tuple[Array, Indices]], directions: DualDirections
) -> DualDirections:
    """Return the directions once `row` is dropped, after the rows `dropped` before; `row` is added to them.

    Each dropped row removes its column of the inverse, which is first reduced by the rows dropped before.
    """
    each = np.arange(len(row))
    column = inverse_gram[:, row]
    for earlier_column, earlier_row in dropped:
        column = column - earlier_column * (earlier_column[row, each] / earlier_column[earlier_row, each])
    dropped.append((column, row))
    pivot = np.maximum(column[row, each], MIN_DIVISOR)
    pivot_rate = directions.multiplier_rate[row, each]
    multiplier_rate = directions.multiplier_rate - column * (pivot_rate / pivot)
    multiplier_rate[row, each] = 0.0
    return DualDirections(multiplier_rate, directions.slope, directions.curvature + pivot_rate**2 / pivot)
