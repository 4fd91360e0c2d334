"""A linear-quadratic regulator about the trajectory, with gains for the vehicle frozen at each instant.

About a reference with specific thrust f, in its axes, the error dynamics are ẍ = f θ_y, ÿ = −f θ_x, z̈ = δf
and θ̈ = δα: chains of four, two and two integrators. The regulator of the chain in fθ does not depend on f.
Therefore the gains on θ are constant and the gains on x fall as 1/f.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from aerobat.control.law import ControlLaw, Seen, controller
from aerobat.control.laws.attitude import moment_for, rotation_error
from aerobat.declaration import Positive
from aerobat.kernels.control import ControllerModel
from aerobat.kernels.control_loops import thrust_demand
from aerobat.kernels.ops import Ops, Scalar
from aerobat.kernels.quaternions import axes, to_body
from aerobat.kernels.rigid_body import RotorWrench
from aerobat.kernels.vectors import clamp_norm, dot, norm, subtract

_MIN_THRUST = 3.0  # [m/s²] smallest thrust in the gains: with less, turning hardly moves the vehicle
_NOMINAL_BANDWIDTH = 25.0  # [rad/s] bandwidth of the attitude loop; vehicles that allow less get slower gains


@lru_cache(maxsize=32)
def regulator(sizes: tuple[float, ...], effort: float) -> tuple[float, ...]:
    """Return the gains of a chain of integrators, by Bryson's rule.

    Args:
        sizes: Errors with equal weight, from the last integral of the chain to the first.
        effort: The input with the same weight.
    """
    from scipy.linalg import solve_continuous_are

    order = len(sizes)
    a, b = np.eye(order, k=1), np.eye(order)[:, -1:]
    cost = solve_continuous_are(a, b, np.diag(1.0 / np.square(sizes)), np.array([[1.0 / effort**2]]))
    return tuple((effort**2 * cost[-1]).tolist())


@controller("lqr")
class Lqr(ControlLaw):
    """The linear-quadratic regulator of the errors about the trajectory, weighted by Bryson's rule."""

    position: Positive = 0.1  # [m] error with the same weight as each error below
    velocity: Positive = 0.8  # [m/s]
    tilt: Positive = 0.6  # [rad] at a specific thrust of 10 m/s²
    rate: Positive = 12.0  # [rad/s] likewise
    angular_acceleration: Positive = 300.0  # [rad/s²] the effort
    thrust: Positive = 6.0  # [m/s²] the effort along the thrust
    max_position_error: Positive = 1.0  # [m] larger errors are clipped to this

    def step(
        self, ops: Ops, model: ControllerModel, state: Any, seen: Seen, elapsed: Scalar
    ) -> tuple[Any, RotorWrench]:
        """Return the force and the moment."""
        k1, k2, k3, k4 = regulator(
            (self.position, self.velocity, 10.0 * self.tilt, 10.0 * self.rate),
            10.0 * self.angular_acceleration,
        )
        z1, z2 = regulator((self.position, self.velocity), self.thrust)
        yaw1, yaw2 = regulator((self.tilt, self.rate), self.angular_acceleration)
        body, reference = seen.body, seen.reference
        body_axes, wanted = axes(body.q_world_body), axes(reference.q_world_body)
        error = clamp_norm(ops, subtract(body.position, reference.position), self.max_position_error)
        x, y, z = to_body(wanted, error)
        vx, vy, vz = to_body(wanted, subtract(body.velocity, reference.velocity))
        tilt_x, tilt_y, turn = rotation_error(body_axes, wanted)
        p, q, r = subtract(body.omega_body, to_body(body_axes, reference.omega))
        demand = thrust_demand(model.airframe.mass_properties, model.environment, reference).value
        f = ops.maximum(norm(ops, demand), _MIN_THRUST)
        ratio = ops.sqrt(0.5 * model.gains.stiffness) / _NOMINAL_BANDWIDTH
        square = ratio * ratio
        pull_x = square * ratio * (k1 * ratio * x + k2 * vx) / f
        pull_y = square * ratio * (k1 * ratio * y + k2 * vy) / f
        acceleration = (
            pull_y - k3 * square * tilt_x - k4 * ratio * p,
            -pull_x - k3 * square * tilt_y - k4 * ratio * q,
            -yaw1 * square * turn - yaw2 * ratio * r,
        )
        thrust = dot(demand, body_axes[2]) - z1 * z - z2 * vz
        mass = model.airframe.mass_properties.mass
        return state, RotorWrench(mass * thrust, moment_for(model, body_axes, reference, acceleration))
