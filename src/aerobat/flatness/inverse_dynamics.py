"""Inverse dynamics of a multirotor with linear drag: the thrust, rates and wrench of a motion at an instant.

The equations are those of `kernels.flatness`. Where the drag coefficients of body x and y differ, d is their
mean, and `unequal_drag` corrects the attitude.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array, xyz
from aerobat.environment import Environment
from aerobat.kernels import flatness as kernel
from aerobat.problem.condition import ForceBalance
from aerobat.states import FlatState, Wrench
from aerobat.vehicle.vehicle import Vehicle

UNDETERMINED = 1e-3  # the attitude is undetermined where |f| is below this fraction of gravity


def body_rates(thrust: Array, q_world_body: Array, determined: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return body rates [rad/s] and accelerations [rad/s²] that keep b3 along f, body axes, (..., 3) each.

    `thrust` holds f, f', f'' (..., 3, 3). Both results are zero where the attitude is not `determined` (...).
    """
    n = np.where(determined, np.linalg.norm(thrust[..., 0, :], axis=-1), np.inf)
    turning = so3.unrotate(q_world_body[..., None, :], thrust[..., 1:, :]) / n[..., None, None]
    jerk, snap = (xyz(turning[..., k, :]) for k in (0, 1))
    omega, omega_dot = kernel.body_rates((0.0, 0.0, 1.0), jerk, snap)
    return np.stack(omega, axis=-1), np.stack(omega_dot, axis=-1)


def wrench_for(thrust: Array, airspeed: Array, omega: Array, omega_dot: Array, vehicle: Vehicle) -> Wrench:
    """Return collective thrust and moment along a path.

    Args:
        thrust: f, f', f'' [m/s², m/s³, m/s⁴], world, (..., 3, 3).
        airspeed: Velocity relative to the wind [m/s], world, (..., 3).
        omega: ω [rad/s], body axes, (..., 3).
        omega_dot: ω' [rad/s²], body axes, (..., 3).
        vehicle: The vehicle.
    """
    f = thrust[..., 0, :]
    n = np.linalg.norm(f, axis=-1)
    b3 = xyz(f / np.where(n > 0.0, n, 1.0)[..., None])
    moment = kernel.moment(vehicle.inertia.tolist(), xyz(omega), xyz(omega_dot))
    collective = kernel.collective(vehicle.mass, axial_drag(vehicle), n, b3, xyz(airspeed))
    return Wrench(collective, np.stack(moment, axis=-1))


def specific_thrust(flat: FlatState, vehicle: Vehicle, environment: Environment) -> Array:
    """Return the specific thrust and two derivatives, f, f', f'' [m/s², m/s³, m/s⁴], world, (..., 3, 3)."""
    airspeed, drag = flat.velocity - environment.wind, lateral_drag(vehicle)
    motion = airspeed, flat.acceleration, flat.jerk, flat.snap
    return np.stack(kernel.specific_thrust(environment.weight, drag, *motion), axis=-2)


def lateral_drag(vehicle: Vehicle) -> float:
    """Return the drag coefficient across the thrust axis per mass, d/m [1/s]."""
    return float(vehicle.drag_body[:2].mean()) / vehicle.mass


def axial_drag(vehicle: Vehicle) -> float:
    """Return the drag coefficient along the thrust minus that across it, per mass, (d_z − d)/m [1/s]."""
    return float(vehicle.drag_body[2]) / vehicle.mass - lateral_drag(vehicle)


def has_unequal_drag(vehicle: Vehicle) -> bool:
    """Return True if drag differs between body x and y, which changes the attitude."""
    return bool(vehicle.drag_body[0] != vehicle.drag_body[1])


def force_balance(environment: Environment, vehicle: Vehicle | None = None) -> ForceBalance:
    """Return the balance of thrust, gravity and drag in an environment; without a vehicle, without drag."""
    drag = 0.0 if vehicle is None else lateral_drag(vehicle)
    return ForceBalance(environment.gravity, drag, environment.wind)
