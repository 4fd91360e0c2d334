"""The distribution of a vehicle's weight among its rotors, and the control that remains after failures.

With the allocation A, a level hover divides the weight in fractions g with A g = (1, 0, 0, 0). To steer from
hover in every direction, every rotor that can only push must bear a part of the weight: g > 0.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array

ROUNDING = 1e-9  # [-] smaller fractions of the weight count as zero
MIN_ROOM = 0.2  # [-] least reserve of a rotor's range above its hover thrust: with less, it hardly steers
MIN_FRACTION = 1e-3  # [-] least fraction of the weight: a rotor that can bear no more has no room to steer


def mixing_matrix(allocation: Array, min_thrusts: Array, max_thrusts: Array) -> Array:
    """Return inverses of allocations, from loads to rotor thrusts, (..., n, 4).

    They are the least-norm inverses over the rotors that give thrust. Where the least-norm hover needs a
    rotor to pull that can only push, and another distribution of the weight does not, the first column is the
    distribution with the largest minimum fraction.

    Args:
        allocation: from rotor thrusts to thrust and moments, (..., 4, n).
        min_thrusts: [N], (..., n).
        max_thrusts: [N], (..., n); zero for a dead rotor.
    """
    lives = np.where(max_thrusts > 0.0, 1.0, 0.0)
    inverses = np.asarray(np.linalg.pinv(allocation * lives[..., None, :]), dtype=np.float64)
    inverses *= lives[..., None]  # exact zeros
    unbalanced = overloaded(inverses[..., 0], min_thrusts, max_thrusts).any(axis=-1)
    for at in map(tuple, np.argwhere(unbalanced)):
        balanced, smallest = balanced_fractions(allocation[at], min_thrusts[at], max_thrusts[at])
        if smallest > MIN_FRACTION:
            inverses[at][:, 0] = balanced
    return inverses


def strength_weighted(
    inverses: Array, allocation: Array, min_thrusts: Array, max_thrusts: Array, weights: Array
) -> Array:
    """Return mixing matrices that leave all rotors `MIN_ROOM` in hover, where the given ones do not.

    Loads are then shared by strength, which minimizes Σ f² / f_max: a rotor that is much weaker than the
    others gives what it can. Vehicles that this does not help keep their mixing matrices.

    Args:
        inverses: the mixing matrices, (..., n, 4).
        allocation: from rotor thrusts to thrust and moments, (..., 4, n).
        min_thrusts: [N], (..., n).
        max_thrusts: [N], (..., n).
        weights: of the vehicles [N], (...).
    """
    limits = min_thrusts, max_thrusts - MIN_ROOM * (max_thrusts - min_thrusts)
    loads = weights[..., None]
    beyond = outside(loads * inverses[..., 0], *limits).any(axis=-1)
    if not beyond.any():
        return inverses
    root = np.sqrt(max_thrusts)
    by_strength = root[..., None] * np.linalg.pinv(allocation * root[..., None, :])
    helps = np.asarray(beyond & ~outside(loads * by_strength[..., 0], *limits).any(axis=-1))
    return np.where(helps[..., None, None], by_strength, inverses)


def outside(thrusts: Array, min_thrusts: Array, max_thrusts: Array) -> NDArray[np.bool_]:
    """Return True for rotors whose thrusts are outside their limits."""
    return np.asarray((thrusts < min_thrusts) | (thrusts > max_thrusts))


def overloaded(fractions: Array, min_thrusts: Array, max_thrusts: Array) -> Array:
    """Return True for rotors that can only push but would have to pull, or to stop, in a hover."""
    return np.asarray((fractions <= ROUNDING) & (min_thrusts >= 0.0) & (max_thrusts > 0.0))


def balanced_fractions(allocation: Array, min_thrusts: Array, max_thrusts: Array) -> tuple[Array, float]:
    """Return the hover fractions of the weight with the largest minimum, (n,), and the minimum.

    This is a linear program: max t with A g = e1 and g ≥ t for rotors that can only push. The minimum is
    minus infinity where there is no hover. `allocation` may lack rows of moments that are not controlled.
    """
    pushes = (max_thrusts > 0.0) & (min_thrusts >= 0.0)
    above = np.c_[-np.eye(len(pushes))[pushes], np.ones(int(pushes.sum()))]
    rewards = np.r_[np.zeros(len(pushes)), 1.0]
    found = _maximized(rewards, allocation, min_thrusts, max_thrusts, above)
    return (found[:-1], float(found[-1])) if found is not None else (np.full(len(pushes), np.nan), -np.inf)


def why_no_hover(allocation: Array, min_thrusts: Array, max_thrusts: Array) -> str:
    """Return the message for rotors that cannot hover and steer, with the control that remains."""
    dead = np.flatnonzero(max_thrusts == 0.0)
    without = f" without {_named(dead.tolist())} (max_thrust = 0)" if len(dead) else ""
    _, without_yaw = balanced_fractions(allocation[:3], min_thrusts, max_thrusts)
    if without_yaw <= MIN_FRACTION:
        rest = (
            "at best spinning remains, not planned here"
            if len(dead)
            else "check position_body, centre_of_mass"
        )
        return (
            f"cannot hold a level hover{without}: the centre of mass is not inside the polygon of those that "
            f"push; {rest}"
        )
    idle = [
        i
        for i in np.flatnonzero((max_thrusts > 0.0) & (min_thrusts >= 0.0)).tolist()
        if _largest_fraction(i, allocation, min_thrusts, max_thrusts) <= MIN_FRACTION
    ]
    why = f"{_named(idle)} would have to stop" if idle else "their torques do not cancel"
    return (
        f"cannot hold a level hover and yaw{without}: {why}; thrust, roll and pitch remain, not enough to "
        "plan for; change some spin"
    )


def _largest_fraction(i: int, allocation: Array, min_thrusts: Array, max_thrusts: Array) -> float:
    """Return the largest fraction of weight that rotor `i` can bear in a hover; infinity without a hover."""
    found = _maximized(np.eye(len(max_thrusts) + 1)[i], allocation, min_thrusts, max_thrusts)
    return np.inf if found is None else float(found[i])


def _maximized(
    rewards: Array, allocation: Array, min_thrusts: Array, max_thrusts: Array, above: Array | None = None
) -> Array | None:
    """Return hover fractions g ≥ 0, and t from 0 to 1, that maximize a linear reward; None without a hover.

    Args:
        rewards: of g and t, (n + 1,).
        allocation: with A g = e1, (4, n), or fewer rows.
        min_thrusts: [N], (n,); rotors that can pull may bear up to the whole weight in either direction.
        max_thrusts: [N], (n,); dead rotors bear nothing.
        above: rows whose products with g and t must not exceed zero, (rows, n + 1).
    """
    from scipy.optimize import linprog  # slow import, needed in unusual cases only

    sizes = np.abs(allocation).max(axis=1, keepdims=True)
    rows = allocation / np.where(sizes > 0.0, sizes, 1.0)
    most = np.where(max_thrusts > 0.0, 1.0, 0.0)
    bounds = np.c_[np.where(min_thrusts < 0.0, -most, 0.0), most]
    found = linprog(
        -rewards,
        A_ub=above,
        b_ub=None if above is None else np.zeros(len(above)),
        A_eq=np.c_[rows, np.zeros(len(rows))],
        b_eq=np.eye(len(rows))[0],  # the first row is already scaled
        bounds=np.r_[bounds, [[0.0, 1.0]]],
    )
    return np.asarray(found.x) if found.status == 0 else None


def _named(rotors: Iterable[int]) -> str:
    """Return rotors by their keys in files: "rotors[1] and rotors[4]"."""
    names = [f"rotors[{i}]" for i in rotors]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
