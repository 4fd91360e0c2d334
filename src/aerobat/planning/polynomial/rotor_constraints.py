"""Rotor thrusts along a polynomial path, in CasADi's symbols.

By flatness, without the terms of b3 × b3' and b3 × b3'' that cancel,

    ω = f × f' / n²,   ω' = f × f'' / n² − 2 (f·f' / n²) ω,   n = |f|,   f = a + g e3 + (d/m) v.

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
from aerobat.optimization.nonlinear import import_casadi
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle
from aerobat.vehicle.allocation import mixer

ROUNDING = 1e-9  # relative differences between rotors that mean nothing
UP = np.array([0.0, 0.0, 1.0])


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
        drag = lateral_drag(self.vehicle)
        airspeed = v - ca.DM(self.environment.wind @ self.axes)
        f = a + ca.DM(self.environment.weight @ self.axes) + drag * airspeed
        df, ddf = j + drag * a, s + drag * j
        squared = ca.dot(f, f)
        turn = self._turn_in_plane if self._planar else self._turn_in_space
        along = ca.dot(f, airspeed) / ca.sqrt(squared)
        thrust = self.vehicle.mass * (ca.sqrt(squared) + axial_drag(self.vehicle) * along)
        thrusts = ca.DM(self._thrusts_from[:, :-2]) @ ca.vertcat(thrust, turn(ca, f, df, ddf, frame))
        low, high = self._thrusts_from[:, -2:].T
        fractions = (thrusts - low) / (high - low)
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
        scaled = np.round(rows / np.maximum(np.abs(rows).max(axis=0), ROUNDING) / ROUNDING)
        return np.asarray(rows[np.sort(np.unique(scaled, axis=0, return_index=True)[1])])

    def _turn_in_plane(self, ca: Any, f: Any, df: Any, ddf: Any, frame: Any) -> Any:
        """Angular acceleration and squared rate about the axis of turning."""
        squared = ca.dot(f, f)
        rate = _cross(f, df) / squared
        return ca.vertcat(_cross(f, ddf) / squared - 2.0 * ca.dot(f, df) / squared * rate, rate**2)

    def _turn_in_space(self, ca: Any, f: Any, df: Any, ddf: Any, frame: Any) -> Any:
        """The moment J ω' + ω × J ω, body axes."""
        squared = ca.dot(f, f)
        rate = ca.cross(f, df) / squared
        change = ca.cross(f, ddf) / squared - 2.0 * ca.dot(f, df) / squared * rate
        x, y, z = frame[:3], frame[3:6], frame[6:]
        b3 = f / ca.sqrt(squared)

        def in_body(across: Any) -> Any:
            """Components of a vector normal to b3 along x and y, turned as z turns to b3."""
            tipped = ca.dot(z, across) / (1.0 + ca.dot(z, b3))
            return ca.vertcat(*(ca.dot(e, across) - ca.dot(e, b3) * tipped for e in (x, y)), 0.0)

        inertia, omega = ca.DM(self.vehicle.inertia), in_body(rate)
        return inertia @ in_body(change) + ca.cross(omega, inertia @ omega)


def _cross(a: Any, b: Any) -> Any:
    return a[0] * b[1] - a[1] * b[0]
