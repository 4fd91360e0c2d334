"""Many vehicles as arrays: each field with a leading axis of vehicles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from aerobat.arrays import Array
from aerobat.states import STANDARD_GRAVITY
from aerobat.vehicle.hover import mixing_matrix, strength_weighted
from aerobat.vehicle.vehicle import Vehicle

_SLACK = 1e-12  # [-] a rotor with a smaller fraction of the collective thrust counts as unloaded


@dataclass(frozen=True, eq=False)
class Fleet:
    """Vehicles with n rotors each; the fields are those of Vehicle and Rotor, stacked."""

    names: tuple[str, ...]
    mass: Array  # [kg], (vehicles,)
    inertia: Array  # [kg·m²], (vehicles, 3, 3)
    drag_body: Array  # [kg/s], (vehicles, 3)
    rotor_positions: Array  # [m], (vehicles, n, 3)
    spins: Array  # (vehicles, n)
    min_thrusts: Array  # [N], (vehicles, n)
    max_thrusts: Array  # [N], (vehicles, n)
    torque_coefficients: Array  # [m], (vehicles, n)
    lags: Array  # [s], (vehicles, n)
    body_centres: Array  # [m] of the enclosing ellipsoids, (vehicles, 3)
    semi_axes: Array  # [m] of the enclosing ellipsoids, (vehicles, 3)

    def __post_init__(self) -> None:
        """Write-protect the arrays."""
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    @classmethod
    def of(cls, vehicles: Sequence[Vehicle]) -> Fleet:
        """Return the fleet of some vehicles with equal numbers of rotors."""
        rotors = [rotor for vehicle in vehicles for rotor in vehicle.rotors]
        shape = (len(vehicles), -1)
        numbers = np.array(
            [(r.spin, r.min_thrust, r.max_thrust, r.torque_coefficient, r.lag) for r in rotors]
        )
        spin, low, high, torque, lag = numbers.T.copy()
        return cls(
            names=tuple(vehicle.name for vehicle in vehicles),
            mass=np.array([vehicle.mass for vehicle in vehicles]),
            inertia=np.concatenate([vehicle.inertia for vehicle in vehicles]).reshape(-1, 3, 3),
            drag_body=np.concatenate([vehicle.drag_body for vehicle in vehicles]).reshape(-1, 3),
            rotor_positions=np.concatenate([r.position_body for r in rotors]).reshape(*shape, 3),
            spins=spin.reshape(shape),
            min_thrusts=low.reshape(shape),
            max_thrusts=high.reshape(shape),
            torque_coefficients=torque.reshape(shape),
            lags=lag.reshape(shape),
            body_centres=np.array([vehicle.bounding_ellipsoid.centre for vehicle in vehicles]),
            semi_axes=np.array([vehicle.bounding_ellipsoid.semi_axes for vehicle in vehicles]),
        )

    def __len__(self) -> int:
        return len(self.mass)

    @cached_property
    def allocation(self) -> Array:
        """The allocations from rotor thrusts to thrust and moments, see `Vehicle`, (vehicles, 4, n)."""
        x, y, _ = np.moveaxis(self.rotor_positions, -1, 0)
        return np.stack([np.ones_like(x), y, -x, -self.spins * self.torque_coefficients], axis=1)

    @cached_property
    def mixer(self) -> Array:
        """The vehicles' mixing matrices, (vehicles, n, 4)."""
        rows = np.concatenate(
            [self.allocation.reshape(len(self), -1), self.max_thrusts > 0.0, self.min_thrusts >= 0.0], axis=1
        )
        same = (rows == rows[0]).all()  # the inverse is expensive, and most fleets share it
        first, place = np.zeros(1, np.intp), np.zeros(len(self), np.intp)
        if not same:
            _, first, place = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        inverses = mixing_matrix(self.allocation[first], self.min_thrusts[first], self.max_thrusts[first])
        rotors = self.allocation, self.min_thrusts, self.max_thrusts
        return strength_weighted(inverses[place.reshape(-1)], *rotors, self.mass * STANDARD_GRAVITY)

    @cached_property
    def collective_range(self) -> Array:
        """The range of collective thrust [N] that can be held without any moment, (vehicles, 2)."""
        fractions = self.mixer[..., 0]
        bears = np.abs(fractions) > _SLACK
        divisor = np.where(bears, fractions, 1.0)
        ends = np.sort([self.min_thrusts / divisor, self.max_thrusts / divisor], axis=0)
        low = np.where(bears, ends[0], -np.inf).max(axis=-1)
        high = np.where(bears, ends[1], np.inf).min(axis=-1)
        return np.stack([low, high], axis=-1)
