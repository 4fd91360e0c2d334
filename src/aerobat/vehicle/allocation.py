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

_SLACK = 1e-12  # a rotor with a smaller share of the collective thrust bears none of it


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
