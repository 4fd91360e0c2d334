"""Rotor commands and body rates along a polynomial path, in CasADi's symbols, by `kernels.flatness`.

In a vertical plane the body turns about one axis of its own. In space its axes are those of a guess, carried
from the guess's thrust direction to the new one by the smallest rotation: exact where the guess is met.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf
from typing import Any

import numpy as np

from aerobat import so3
from aerobat.arrays import Array, Mask
from aerobat.environment import Environment
from aerobat.flatness import axial_drag, lateral_drag, reference
from aerobat.kernels import flatness as kernel
from aerobat.kernels.ops import Vector
from aerobat.kernels.quaternions import to_body
from aerobat.kernels.vectors import dot, scale
from aerobat.optimization.nonlinear import import_casadi
from aerobat.so3 import UP
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle
from aerobat.vehicle.allocation import mixer

ROTOR_DIFFERENCE = 1e-9  # relative differences between rotors that mean nothing
THRUST_FLOOR = 0.02  # of gravity, the least specific thrust: more, and the attitude stays determined


@dataclass(frozen=True, eq=False)
class RotorConstraints:
    """Commands f + τ f′ of a vehicle's rotors, each as a part of its range, 0 to 1; |f|², and |ω|².

    The last two are over gravity's and over the largest body rate's square, where there is one.
    """

    vehicle: Vehicle
    axes: Array  # of motion, orthonormal columns, (3, d); d = 2: in a vertical plane, the second up
    environment: Environment
    heading: float  # [rad]

    @property
    def frame_size(self) -> int:
        """The number of components of a frame."""
        return 3 if self._planar else 9

    @property
    def lags(self) -> bool:
        """Whether thrusts follow their commands late, so that crackle counts."""
        return bool(self.vehicle.lags.any())

    @property
    def names(self) -> tuple[str, ...]:
        """The limits' names, one a value."""
        rotors = ["rotor commands" if self.lags else "rotor thrusts"] * len(self._thrusts_from)
        return (*rotors, "least thrust", *(["body rate"] if self._rate_is_limited else []))

    @property
    def limits(self) -> tuple[Array, Array]:
        """The least and the most of every value, (size,) each."""
        count = len(self._thrusts_from)
        rate = [1.0] if self._rate_is_limited else []
        lower = [*np.zeros(count), THRUST_FLOOR**2, *(-inf for _ in rate)]
        return np.array(lower), np.array([*np.ones(count), inf, *rate])

    @property
    def has_range(self) -> Mask:
        """Whether a value has a range of which a part can be kept: not the floor of thrust, (size,)."""
        lower, upper = self.limits
        return np.asarray((lower == 0.0) | (upper < inf))

    def frames(self, trajectory: Trajectory, times: Array) -> Array:
        """Body axes in the world along a trajectory, (9, n): x, y and z; or the axis of turning, (3, n)."""
        if self._planar:
            return np.repeat(self._turning_axis[:, None], len(times), axis=1)
        q = reference(trajectory, self.vehicle, times, environment=self.environment).setpoint.q_world_body
        return np.swapaxes(so3.axes(q), -1, -2).reshape(len(times), 9).T

    def values(self, motion: list[Any], frame: Any) -> Any:
        """The values, a column, of velocity to crackle (d,) each and the frame."""
        ca = import_casadi()
        v, a, j, s, crackle = motion
        airspeed = v - ca.DM(self.environment.wind @ self.axes)
        weight = ca.DM(self.environment.weight @ self.axes)
        thrusts = kernel.specific_thrust(weight, lateral_drag(self.vehicle), airspeed, a, j, s)
        f, jerk, snap, airspeed = (self._local(vector, frame) for vector in (*thrusts, airspeed))
        squared = dot(f, f)
        n = ca.sqrt(squared)
        b3 = scale(1 / n, f)
        omega, omega_dot = kernel.body_rates(f, scale(1 / squared, jerk), scale(1 / squared, snap))
        collective = kernel.collective(self.vehicle.mass, axial_drag(self.vehicle), n, b3, airspeed)
        if self._planar:
            turning = ca.vertcat(omega_dot[2], omega[2] ** 2)
        else:
            body = ((*kernel.tilted(b3, rate), 0.0) for rate in (omega, omega_dot))
            turning = ca.vertcat(*kernel.moment(self.vehicle.inertia.tolist(), *body))
        rotors = ca.DM(self._thrusts_from[:, :-3]) @ ca.vertcat(collective, turning)
        low, high, lag = self._thrusts_from[:, -3:].T
        if self.lags:
            rates = ca.jtimes(rotors, ca.vertcat(v, a, j, s), ca.vertcat(a, j, s, crackle))
            rotors += lag * rates
        values = [(rotors - low) / (high - low), squared / self.environment.gravity**2]
        if self._rate_is_limited:
            values.append(dot(omega, omega) / self.vehicle.max_body_rate**2)
        return ca.vertcat(*values)

    @property
    def _planar(self) -> bool:
        return int(self.axes.shape[1]) == 2

    @property
    def _rate_is_limited(self) -> bool:
        return self.vehicle.max_body_rate < inf

    @cached_property
    def _turning_axis(self) -> Array:
        """In a plane, the axis of turning from its first axis to its second, body axes, (3,)."""
        return so3.rotate(
            so3.about_axis(UP, np.array(-self.heading)), np.cross(self.axes[:, 0], self.axes[:, 1])
        )

    @cached_property
    def _thrusts_from(self) -> Array:
        """Rotors that differ: thrust from collective thrust and moment, its limits [N] and lag [s], (r, 7).

        In a plane, from collective thrust, angular acceleration and squared rate, (r, 6).
        """
        vehicle, mix = self.vehicle, mixer(self.vehicle)
        own = [vehicle.min_thrusts[:, None], vehicle.max_thrusts[:, None], vehicle.lags[:, None]]
        if not self._planar:
            return np.hstack([mix, *own])
        axis = self._turning_axis
        moments = np.stack([vehicle.inertia @ axis, np.cross(axis, vehicle.inertia @ axis)], axis=1)
        rows = np.hstack([mix[:, :1], mix[:, 1:] @ moments, *own])
        scaled = np.round(rows / np.maximum(np.abs(rows).max(axis=0), ROTOR_DIFFERENCE) / ROTOR_DIFFERENCE)
        return np.asarray(rows[np.sort(np.unique(scaled, axis=0, return_index=True)[1])])

    def _local(self, vector: Any, frame: Any) -> Vector:
        """Components of a vector in the guess's body axes; in a plane in its own, the third across it."""
        if self._planar:
            return vector[0], vector[1], 0.0
        x, y, z = ((frame[k], frame[k + 1], frame[k + 2]) for k in (0, 3, 6))
        return to_body((x, y, z), (vector[0], vector[1], vector[2]))
