"""Conversion between rotor thrusts and the wrench, for any n >= 4 rotors; leading axes broadcast."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from aerobat.arrays import Array
from aerobat.states import Wrench
from aerobat.vehicle.vehicle import Vehicle


@lru_cache(maxsize=128)
def mixer(vehicle: Vehicle) -> Array:
    """Return the mixing matrix, an inverse of the allocation from loads to rotor thrusts, (n, 4).

    This is the least-norm inverse wherever that can be flown, see `mixing_matrix`. Raises SpecError for a
    vehicle that its dead rotors leave without control.
    """
    vehicle.without_dead_rotors()
    return vehicle.mixer


def wrench(vehicle: Vehicle, thrusts: Array) -> Wrench:
    """Return the wrench on the body of rotor thrusts [N], (..., n)."""
    effect = np.asarray(thrusts, dtype=float) @ vehicle.allocation.T
    return Wrench(thrust=effect[..., 0], moment_body=effect[..., 1:])


def rotor_thrusts(vehicle: Vehicle, wrench: Wrench) -> Array:
    """Return rotor thrusts [N] for exactly this wrench, by the vehicle's mixer, (..., n), without limits."""
    inverse = mixer(vehicle)
    collective = np.asarray(wrench.thrust, dtype=float)[..., None] * inverse[:, 0]
    return np.asarray(collective + np.asarray(wrench.moment_body, dtype=float) @ inverse[:, 1:].T)
