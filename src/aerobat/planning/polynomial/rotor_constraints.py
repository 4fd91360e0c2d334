"""Rotor thrusts along a polynomial path, in CasADi's symbols, by the equations of `kernels.flatness`.

In a vertical plane the body turns about one axis of its own. In space its axes are those of a guess, carried
from the guess's thrust direction to the new one by the smallest rotation: exact where the guess is met.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
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


@dataclass(frozen=True, eq=False)
class RotorConstraints:
    """Thrusts of a vehicle's rotors, each as a part of its range, 0 to 1, then |f|² over gravity's."""

    vehicle: Vehicle
    axes: Array  # of motion, orthonormal columns, (3, d); d = 2: in a vertical plane, the second up
    environment: Environment
    heading: float  # [rad]

    @property
    def size(self) -> int:
        """The number of values at a sample."""
        return len(self._thrusts_from) + 1

    def frames(self, trajectory: Trajectory, times: Array) -> Array:
        """Body axes in the world along a trajectory, (9, n): x, y and z; or the axis of turning, (3, n)."""
        if self._planar:
            return np.repeat(self._turning_axis[:, None], len(times), axis=1)
        q = reference(trajectory, self.vehicle, times, environment=self.environment).setpoint.q_world_body
        return np.swapaxes(so3.axes(q), -1, -2).reshape(len(times), 9).T

    @cached_property
    def function(self) -> Any:
        """(derivatives 1 to 4 by normalised time (4 d,), duration, frame) -> values (size,)."""
        ca, d = import_casadi(), self.axes.shape[1]
        moving, duration = ca.SX.sym("moving", 4 * d), ca.SX.sym("T")
        frame = ca.SX.sym("frame", 3 if self._planar else 9)
        v, a, j, s = (moving[k * d : (k + 1) * d] / duration ** (k + 1) for k in range(4))
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
        rotors = ca.DM(self._thrusts_from[:, :-2]) @ ca.vertcat(collective, turning)
        low, high = self._thrusts_from[:, -2:].T
        fractions = (rotors - low) / (high - low)
        values = ca.vertcat(fractions, squared / self.environment.gravity**2)
        return ca.Function("rotors", [moving, duration, frame], [values])

    @property
    def _planar(self) -> bool:
        return int(self.axes.shape[1]) == 2

    @cached_property
    def _turning_axis(self) -> Array:
        """In a plane, the axis of turning from its first axis to its second, body axes, (3,)."""
        return so3.rotate(
            so3.about_axis(UP, np.array(-self.heading)), np.cross(self.axes[:, 0], self.axes[:, 1])
        )

    @cached_property
    def _thrusts_from(self) -> Array:
        """Rotors that differ: thrust from collective thrust and moment, least and largest [N], (r, 6).

        In a plane, from collective thrust, angular acceleration and squared rate, (r, 5).
        """
        vehicle, mix = self.vehicle, mixer(self.vehicle)
        limits = [vehicle.min_thrusts[:, None], vehicle.max_thrusts[:, None]]
        if not self._planar:
            return np.hstack([mix, *limits])
        axis = self._turning_axis
        moments = np.stack([vehicle.inertia @ axis, np.cross(axis, vehicle.inertia @ axis)], axis=1)
        rows = np.hstack([mix[:, :1], mix[:, 1:] @ moments, *limits])
        scaled = np.round(rows / np.maximum(np.abs(rows).max(axis=0), ROTOR_DIFFERENCE) / ROTOR_DIFFERENCE)
        return np.asarray(rows[np.sort(np.unique(scaled, axis=0, return_index=True)[1])])

    def _local(self, vector: Any, frame: Any) -> Vector:
        """Components of a vector in the guess's body axes; in a plane in its own, the third across it."""
        if self._planar:
            return vector[0], vector[1], 0.0
        x, y, z = ((frame[k], frame[k + 1], frame[k + 2]) for k in (0, 3, 6))
        return to_body((x, y, z), (vector[0], vector[1], vector[2]))
