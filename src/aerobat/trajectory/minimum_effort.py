"""Closed-form minimum-effort polynomials through waypoints (paper, Section V-B; Cutler and How, 2012).

Among all curves with the fixed derivatives at the knots, this curve has the smallest ∫ |d^s p/dt^s|² dt:
minimum jerk for s = 3, minimum snap for 4, minimum crackle for 5. The curve consists of polynomials of degree
2s - 1. Where derivative d < s is free at a knot, derivative 2s - 1 - d is continuous there, and zero at an
end of the course.
"""

from __future__ import annotations

import math
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike

from aerobat.arrays import AXES, Array, Mask, frozen
from aerobat.declaration import Angle, shown, validated
from aerobat.errors import SpecError
from aerobat.trajectory.knot_conditions import KnotConditions
from aerobat.trajectory.piecewise import Trajectory

ORDERS = {3: "jerk", 4: "snap", 5: "crackle"}


class ContinuityRule(StrEnum):
    """The derivative whose continuity is given up at an inner knot for each fixed derivative."""

    VARIATIONAL = "variational"  # derivative 2s - 1 - d for a fixed derivative d: minimum effort
    # the highest that remain, as in Cutler and How: more effort, but low derivatives stay continuous
    HIGHEST = "highest"


@validated
def minimum_effort(
    fixed: ArrayLike,
    durations: ArrayLike,
    rule: ContinuityRule | str = ContinuityRule.VARIATIONAL,
    heading: Angle = 0.0,
) -> Trajectory:
    """Return polynomials of degree 2s - 1 on n segments with the fixed derivatives at their n + 1 knots.

    By the variational rule the result is the minimizer of ∫ |d^s p/dt^s|² dt, `Trajectory.effort(s)`. Each
    axis is independent of the others. Time and memory grow linearly with n. The paper's curves, of degree 9,
    have s = 5.

    SpecError is raised for other shapes, durations that are not positive, infinities, and an end without a
    position. It is also raised where too few derivatives are fixed to determine the curve, and where
    durations differ by more orders of magnitude than float64 can resolve.

    Args:
        fixed: Derivatives 0 to s - 1 of position [m/s^d], world, (n + 1, s, 3), NaN where a derivative is
            free.
        durations: Durations of the segments [s], (n,).
        rule: The derivative whose continuity is given up for each fixed derivative.
        heading: The trajectory's heading [rad].
    """
    lengths = _positive(durations)
    values, known = _split(fixed, len(lengths))
    coefficients = np.empty((len(lengths), 2 * known.shape[1], 3))
    for axes in _alike(known):
        pattern = known[..., axes[0]]
        _check_determined(pattern, lengths, AXES[axes[0]])
        coefficients[..., axes] = _conditions(pattern, lengths, _checked(rule)).solve(values[..., axes])
    return Trajectory(lengths, coefficients, heading)


def _conditions(known: Mask, durations: Array, rule: ContinuityRule) -> KnotConditions:
    """Return the conditions at all knots for components with the fixed derivatives `known` (n + 1, s)."""
    order = known.shape[1]
    fixed = np.concatenate([known, np.zeros_like(known)], axis=1)
    variational = ~fixed & ~fixed[:, ::-1]
    continuous = variational.copy() if rule is ContinuityRule.VARIATIONAL else _without_highest(fixed)
    # an end of the course has no neighbour: a free derivative d makes derivative 2s - 1 - d zero
    ends = [0, -1]
    continuous[ends] = variational[ends] & (np.arange(2 * order) >= order)
    return KnotConditions(durations, fixed, continuous)


def _without_highest(fixed: Mask) -> Mask:
    """Return the free derivatives of each knot without the highest ones, as many as derivatives are fixed."""
    from_top = np.cumsum(~fixed[:, ::-1], axis=1)[:, ::-1]
    return np.asarray(~fixed & (from_top > fixed.sum(axis=1, keepdims=True)))


def _check_determined(known: Mask, durations: Array, axis: str) -> None:
    """Raise SpecError if conditions (n + 1, s) leave the curve undetermined.

    That is so where a nonzero polynomial of degree below s satisfies them all with zero values. Fixed values
    whose lower derivatives are fixed at the same knot (Hermite) determine such a polynomial by their number,
    others (Birkhoff) by the rank of their matrix.
    """
    order = known.shape[1]
    if np.logical_and.accumulate(known, axis=1).sum() >= order:
        return
    times = np.append(0.0, np.cumsum(durations / durations.sum()))
    rows = [
        [math.perm(power, d) * times[knot] ** max(power - d, 0) for power in range(order)]
        for knot, d in np.argwhere(known)
    ]
    missing = order - int(np.linalg.matrix_rank(np.array(rows)))
    if missing:
        raise SpecError(
            f"fixed leaves the curve along {axis} undetermined; give {missing} more of its derivatives "
            f"for minimum {ORDERS[order]}, at the ends for instance"
        )


def _alike(known: Mask) -> list[list[int]]:
    """Return groups of axes with the same fixed derivatives."""
    groups: dict[bytes, list[int]] = {}
    for axis in range(3):
        groups.setdefault(known[..., axis].tobytes(), []).append(axis)
    return list(groups.values())


def _positive(durations: ArrayLike) -> Array:
    lengths = frozen(durations, "durations", (None,))
    if lengths.ndim != 1 or lengths.size == 0 or not (lengths > 0).all():
        raise SpecError("durations must be a list of at least one positive number of seconds")
    return lengths


def _split(fixed: ArrayLike, segments: int) -> tuple[Array, Mask]:
    """Return fixed values (zero where free) and the mask of fixed derivatives, (n + 1, s, 3) each."""
    try:
        array = np.array(fixed, dtype=np.float64)
    except (TypeError, ValueError):
        raise SpecError("fixed must be an array of numbers, NaN where a derivative is free") from None
    shape = array.shape
    if shape[:1] + shape[2:] != (segments + 1, 3) or shape[1] not in ORDERS:
        raise SpecError(
            "fixed must have the shape (knots, derivatives, 3) with 3, 4 or 5 derivatives and "
            f"{segments + 1} knots, one more than durations, got {shape}"
        )
    known = ~np.isnan(array)
    if not known[[0, -1], 0].all():
        raise SpecError("fixed must hold the position at both ends, in all three components")
    return frozen(np.where(known, array, 0.0), "fixed"), known


def _checked(rule: ContinuityRule | str) -> ContinuityRule:
    try:
        return ContinuityRule(rule)
    except ValueError:
        raise SpecError(f"rule must be one of {', '.join(ContinuityRule)}, got {shown(rule)}") from None
