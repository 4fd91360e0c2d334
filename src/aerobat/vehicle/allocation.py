"""Rotor thrusts <-> wrench, for any n >= 4 rotors; leading axes broadcast."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from aerobat.arrays import Array
from aerobat.states import Wrench
from aerobat.vehicle.vehicle import Vehicle


@lru_cache(maxsize=128)
def mixer(vehicle: Vehicle) -> Array:
    """The inverse of the allocation by which loads are shared among rotors, (n, 4).

    The least-norm one wherever that can be flown, see `mixing_matrix`. Raises SpecError for a vehicle that
    its dead rotors leave without control.
    """
    vehicle.without_dead_rotors()
    return vehicle.mixer


def wrench(vehicle: Vehicle, thrusts: Array) -> Wrench:
    """The wrench on the body of rotor thrusts [N], (..., n)."""
    effect = np.asarray(thrusts, dtype=float) @ vehicle.allocation.T
    return Wrench(thrust=effect[..., 0], moment_body=effect[..., 1:])


def rotor_thrusts(vehicle: Vehicle, wrench: Wrench) -> Array:
    """Rotor thrusts [N] that make a wrench exactly, by the vehicle's mixer, (..., n), limits ignored."""
    inverse = mixer(vehicle)
    collective = np.asarray(wrench.thrust, dtype=float)[..., None] * inverse[:, 0]
    return np.asarray(collective + np.asarray(wrench.moment_body, dtype=float) @ inverse[:, 1:].T)
