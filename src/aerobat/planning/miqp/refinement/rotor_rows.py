"""What a vehicle can do along a path, and its slopes: rotor thrusts, their commands, thrust and body rate.

In body axes that are carried with the thrust axis by the smallest rotation from those of the path as it is:
exact where the path is met, and exact to first order beside it. Slopes come from a complex step, which knows
no cancellation (Squire and Trapp, "Using complex variables to estimate derivatives of real functions", 1998).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.environment import Environment
from aerobat.flatness import axial_drag, lateral_drag
from aerobat.flatness.parallel_transport import frames
from aerobat.flatness.references import UNDETERMINED, specific_thrust
from aerobat.kernels import flatness as kernel
from aerobat.kernels.ops import Vector
from aerobat.kernels.vectors import dot, scale
from aerobat.vehicle import Vehicle, mixer

MIN_THRUST = 0.05  # of gravity: specific thrust is kept above, lest the attitude be undetermined
COMPLEX_STEP = 1e-20
TINY = 1e-18  # beside the square of a limit: a body at rest has a rate with a slope
MOVING = slice(1, 6)  # velocity to crackle: what thrusts depend on


@dataclass(frozen=True, eq=False)
class RotorRows:
    """A vehicle's limits as constraints c ≤ 0 on a path's derivatives, each as a fraction of its range."""

    vehicle: Vehicle
    environment: Environment
    heading: float  # [rad]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the constraints, each in a few words."""
        rotors = range(len(self.vehicle.rotors))
        kinds = ["thrust", "command"] if self.vehicle.lags.any() else ["thrust"]
        sides = (f"the {kind} of rotor {i} is" for kind in kinds for _ in ("low", "high") for i in rotors)
        return (*sides, "the collective thrust is next to nothing,", "the body rate is")

    def frames(self, times: Array, derivatives: Array) -> Array:
        """Body axes in the world, as columns, (m, 3, 3), along a path's derivatives (m, 6, 3)."""
        velocity, acceleration, jerk, snap = np.moveaxis(derivatives[:, 1:5], 1, 0)
        airspeed = velocity - self.environment.wind
        thrust = specific_thrust(self.vehicle, self.environment, airspeed, acceleration, jerk, snap)
        path = frames(times, thrust, UNDETERMINED * self.environment.gravity, self.heading)
        return so3.axes(path.q_world_body[path.samples])

    def values(self, derivatives: Array, frames: Array) -> Array:
        """The constraints at derivatives (m, 6, 3), (m, c)."""
        values: Array = self._constraints(self._moving(derivatives) @ frames, frames)
        return values

    def slopes(self, derivatives: Array, frames: Array) -> Array:
        """Their slopes by the derivatives, (m, c, 6, 3)."""
        local = self._moving(derivatives) @ frames
        directions = np.eye(15).reshape(15, 1, 5, 3)
        values = self._constraints(local + 1j * COMPLEX_STEP * directions, frames)
        by_local = np.moveaxis(values.imag / COMPLEX_STEP, 0, -1).reshape(*values.shape[1:], 5, 3)
        slopes = np.zeros((*values.shape[1:], 6, 3))
        slopes[..., MOVING, :] = by_local @ np.swapaxes(frames, -1, -2)[:, None]
        return slopes

    def _moving(self, derivatives: Array) -> Array:
        """Airspeed, acceleration, jerk, snap and crackle, (m, 5, 3)."""
        moving = derivatives[:, MOVING].copy()
        moving[:, 0] -= self.environment.wind
        return moving

    def _constraints(self, moving: Any, frames: Array) -> Any:
        """The constraints of airspeed to crackle in body axes (..., m, 5, 3), (..., m, c)."""
        drag = lateral_drag(self.vehicle)
        airspeed, acceleration, jerk, snap, crackle = np.moveaxis(moving, -2, 0)
        weight = self.environment.weight @ frames
        f, f1, f2 = kernel.specific_thrust(weight, drag, airspeed, acceleration, jerk, snap)
        vectors = [_components(x) for x in (f, f1, f2, crackle + drag * snap, airspeed, acceleration)]
        norm = dot(vectors[0], vectors[0]) ** 0.5
        b3, *rates = (scale(1.0 / norm, vector) for vector in vectors[:4])
        omega, omega_dot = kernel.body_rates(b3, rates[0], rates[1])
        turning = [omega, omega_dot, kernel.angular_jerk(b3, *rates)]
        wrench, wrench_rate = self._wrenches(b3, norm, vectors, turning)
        thrusts = wrench @ self._mixer
        low, high = self.vehicle.min_thrusts, self.vehicle.max_thrusts
        span = high - low
        commands = thrusts + self.vehicle.lags * (wrench_rate @ self._mixer)
        columns = [(low - thrusts) / span, (thrusts - high) / span]
        if self.vehicle.lags.any():
            columns += [(low - commands) / span, (commands - high) / span]
        columns.append((MIN_THRUST - norm / self.environment.gravity)[..., None])
        if np.isfinite(self.vehicle.max_body_rate):
            rate = (dot(omega, omega) / self.vehicle.max_body_rate**2 + TINY) ** 0.5
            columns.append((rate - 1.0)[..., None])
        return np.concatenate(columns, axis=-1)

    def _wrenches(
        self, b3: Vector, norm: Any, vectors: list[Vector], turning: list[Vector]
    ) -> tuple[Any, Any]:
        """Collective thrust and moment (..., m, 4), and their derivatives.

        Args:
            b3: the thrust axis.
            norm: of the specific thrust.
            vectors: specific thrust, its first three derivatives, airspeed and acceleration.
            turning: the body rates and their first two derivatives.
        """
        mass, axial, inertia = self.vehicle.mass, axial_drag(self.vehicle), self.vehicle.inertia.tolist()
        _, f1, _, _, airspeed, acceleration = vectors
        local = [(*kernel.tilted(b3, vector), 0.0 * norm) for vector in turning]
        thrust = kernel.collective(mass, axial, norm, b3, airspeed)
        thrust_rate = kernel.collective_rate(mass, axial, b3, (norm, f1), (airspeed, acceleration))
        moment = kernel.moment(inertia, local[0], local[1])
        moment_rate = kernel.moment_rate(inertia, *local)
        return np.stack([thrust, *moment], axis=-1), np.stack([thrust_rate, *moment_rate], axis=-1)

    @cached_property
    def _mixer(self) -> Array:
        return mixer(self.vehicle).T


def _components(vectors: Any) -> Vector:
    return vectors[..., 0], vectors[..., 1], vectors[..., 2]
