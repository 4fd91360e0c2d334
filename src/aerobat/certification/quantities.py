"""Certified quantities: rotor thrusts, collective thrust, tilt, body rate and moment, as analytic functions.

Magnitudes are squared and the tilt is replaced by its cosine, because interpolation needs smooth functions.
An `ExtremumQuery` converts them back.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from aerobat.arrays import Array, frozen
from aerobat.flatness.inverse_dynamics import wrench_for
from aerobat.vehicle import Vehicle, mixer, rotor_thrusts


@dataclass(frozen=True)
class MagnitudeBounds:
    """Bounds or errors of the arguments of the quantities; all (...)."""

    thrust: Array  # [N]
    cos_tilt: Array  # [-]
    omega: Array  # [rad/s]
    omega_dot: Array  # [rad/s²]


def values(vehicle: Vehicle, curve: Array, omega: Array, omega_dot: Array) -> Array:
    """Return rotor thrusts, collective thrust, cos tilt, |ω|², |M|², (..., n + 4).

    Args:
        vehicle: The vehicle, with n rotors.
        curve: v, f, f', f'' from a `ThrustCurve`, (..., 4, 3).
        omega: ω [rad/s], body axes, (..., 3).
        omega_dot: ω' [rad/s²], body axes, (..., 3).
    """
    airspeed, thrust = curve[..., 0, :], curve[..., 1:, :]
    wrench = wrench_for(thrust, airspeed, omega, omega_dot, vehicle)
    cos_tilt = thrust[..., 0, 2] / np.linalg.norm(thrust[..., 0, :], axis=-1)
    squares = (np.sum(vector**2, axis=-1) for vector in (omega, wrench.moment_body))
    others = np.stack([wrench.thrust, cos_tilt, *squares], axis=-1)
    return np.concatenate([rotor_thrusts(vehicle, wrench), others], axis=-1)


def bounds(vehicle: Vehicle, magnitudes: MagnitudeBounds) -> Array:
    """Return upper bounds of |`values`| for arguments of these magnitudes, (..., n + 4)."""
    moment = _moment(vehicle, magnitudes)
    squares = magnitudes.omega**2, moment**2
    return _stacked(vehicle, magnitudes.thrust, moment, magnitudes.cos_tilt, *squares)


def errors(vehicle: Vehicle, magnitudes: MagnitudeBounds, of: MagnitudeBounds) -> Array:
    """Return the errors of `values`, (..., n + 4), for small errors `of` in arguments of these magnitudes."""
    moment = _inertia(vehicle) * (of.omega_dot + 2 * magnitudes.omega * of.omega)
    squares = 2 * magnitudes.omega * of.omega, 2 * _moment(vehicle, magnitudes) * moment
    return _stacked(vehicle, of.thrust, moment, of.cos_tilt, *squares)


@lru_cache(maxsize=128)
def scales(vehicle: Vehicle) -> Array:
    """Return values that count as large, (n + 4,): the rotors' ranges and the moments that use them up."""
    ranges = vehicle.thrust_ranges
    moment = float((ranges / np.linalg.norm(mixer(vehicle)[:, 1:], axis=1)).max())
    return frozen([*ranges, ranges.sum(), 0.01, 1.0, moment**2], "scales")


def _stacked(vehicle: Vehicle, thrust: Array, moment: Array, *others: Array) -> Array:
    inverse = mixer(vehicle)
    per_thrust = np.abs(inverse[:, 0])
    per_moment = np.linalg.norm(inverse[:, 1:], axis=1)
    rotors = thrust[..., None] * per_thrust + moment[..., None] * per_moment
    return np.concatenate([rotors, np.stack([thrust, *others], axis=-1)], axis=-1)


def _moment(vehicle: Vehicle, magnitudes: MagnitudeBounds) -> Array:
    return _inertia(vehicle) * (magnitudes.omega_dot + magnitudes.omega**2)


@lru_cache(maxsize=128)
def _inertia(vehicle: Vehicle) -> float:
    """Return the largest principal moment of inertia."""
    return float(np.linalg.norm(vehicle.inertia, 2))
