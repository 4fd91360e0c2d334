"""Rotor thrusts <-> wrench, for any n >= 4 rotors; leading axes broadcast.

With rotor i at (x, y, z) in body axes (FLU, from the centre of mass), thrust f_i along +z, spin s_i and
torque coefficient c_i, the wrench is

    T = Σ f_i    Mx = Σ y_i f_i    My = -Σ x_i f_i    Mz = -Σ s_i c_i f_i

since r × f e3 = (y f, -x f, 0), and since a rotor that turns counter-clockwise (s = +1) drives the body
clockwise. Sections III and V-C of the paper use such a matrix for a hexarotor and a quadrotor.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from aerobat.arrays import Array, frozen
from aerobat.states import Wrench

if TYPE_CHECKING:
    from aerobat.vehicle.vehicle import Rotor, Vehicle

# [-] of a rotor's range: thrusts that rounding puts past a limit, changes too small to meet one.
_SLACK = 1e-12


def allocation_matrix(rotors: Sequence[Rotor]) -> Array:
    """The map from rotor thrusts [N] to (T [N], Mx, My, Mz [N·m]), (4, n)."""
    x, y, _ = np.array([rotor.position_body for rotor in rotors]).T
    drag_torque = [-rotor.spin * rotor.torque_coefficient for rotor in rotors]
    return np.array([np.ones_like(x), y, -x, drag_torque])


@lru_cache(maxsize=128)
def mixer(vehicle: Vehicle) -> Array:
    """The least-norm inverse of the allocation matrix, (n, 4)."""
    return frozen(np.linalg.pinv(vehicle.allocation), "mixer")


def wrench(vehicle: Vehicle, thrusts: Array) -> Wrench:
    """What rotor thrusts [N], (..., n), do to the body."""
    effect = np.asarray(thrusts, dtype=float) @ vehicle.allocation.T
    return Wrench(thrust=effect[..., 0], moment_body=effect[..., 1:])


def rotor_thrusts(vehicle: Vehicle, wrench: Wrench) -> Array:
    """The least-norm rotor thrusts [N] that make a wrench exactly, (..., n), limits ignored."""
    inverse = mixer(vehicle)
    collective = np.asarray(wrench.thrust, dtype=float)[..., None] * inverse[:, 0]
    return np.asarray(collective + np.asarray(wrench.moment_body, dtype=float) @ inverse[:, 1:].T)


@lru_cache(maxsize=128)
def collective_range(vehicle: Vehicle) -> tuple[float, float]:
    """The least and the most collective thrust [N] that the rotors can hold without any moment."""
    direction = mixer(vehicle)[:, 0]
    moving = np.abs(direction) > _SLACK
    ends = np.sort([vehicle.min_thrusts[moving], vehicle.max_thrusts[moving]] / direction[moving], axis=0)
    return float(ends[0].max()), float(ends[1].min())


def allocate(vehicle: Vehicle, wrench: Wrench) -> Array:
    """Rotor thrusts within their limits [N], (..., n), that make a wrench, or as much of it as fits.

    Where the least-norm thrusts fit, they are the answer and the wrench is made exactly. Elsewhere the
    collective comes first, then roll and pitch, and yaw last:

        f = T m0 + a (Mx m1 + My m2) + b Mz m3    with m0..m3 the columns of the mixer,

    T brought into `collective_range`, a the largest in [0, 1] that fits without yaw, then b the largest in
    [0, 1] that fits. Roll and pitch are whole (a = 1) wherever giving up yaw makes them fit. A redundant
    vehicle (n > 4) may reach some of these wrenches by thrusts of a larger norm; those are not searched for.
    """
    lower, upper = vehicle.min_thrusts, vehicle.max_thrusts
    slack = _SLACK * (upper - lower)
    exact = rotor_thrusts(vehicle, wrench)
    fits = ((exact >= lower - slack) & (exact <= upper + slack)).all(axis=-1, keepdims=True)

    inverse, moment = mixer(vehicle), np.asarray(wrench.moment_body, dtype=float)
    collective = np.clip(wrench.thrust, *collective_range(vehicle))[..., None] * inverse[:, 0]
    tilted = _as_far_as_fits(collective, moment[..., :2] @ inverse[:, 1:3].T, lower, upper)
    turned = _as_far_as_fits(tilted, moment[..., 2:] * inverse[:, 3], lower, upper)
    return np.clip(np.where(fits, exact, turned), lower, upper)


def _as_far_as_fits(base: Array, change: Array, lower: Array, upper: Array) -> Array:
    """base + s·change with the largest s in [0, 1] within limits, (..., n), for a base within them."""
    room = np.maximum(np.where(change > 0, upper - base, base - lower), 0.0)
    size = np.abs(change)
    matters = size > _SLACK * (upper - lower)
    share = np.where(matters, room / np.where(matters, size, 1.0), 1.0).min(axis=-1, keepdims=True)
    return np.asarray(base + np.minimum(share, 1.0) * change)
