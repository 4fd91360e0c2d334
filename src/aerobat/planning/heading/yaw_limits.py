"""Constraint values of the vehicle's limits at instants of a path, as functions of the yaw."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from aerobat import so3
from aerobat.arrays import Array, xyz
from aerobat.flatness import axial_drag, lateral_drag, reference
from aerobat.kernels import flatness as kernel
from aerobat.kernels.vectors import dot
from aerobat.limits.limit import Limit
from aerobat.limits.quantity import MEASURES
from aerobat.planning.task import Task
from aerobat.states import Setpoint
from aerobat.trajectory import Trajectory

DIFFERENCE = 1e-6  # step of central differences, in SI units of the yaw and its derivatives
ORDERS = 4  # the yaw and its first three derivatives, on which rotor commands depend


@dataclass(frozen=True, eq=False)
class YawLimits:
    """Limits on measures along a path with a yaw; drag along body x and y is replaced by its mean."""

    task: Task
    path: Trajectory
    times: Array  # [s], (m,)

    @cached_property
    def carried(self) -> Setpoint:
        """The setpoints without yaw: the body never rotates about its thrust axis."""
        task = self.task
        found = reference(self.path, task.vehicle, self.times, environment=task.environment)
        return found.setpoint

    def excess(self, yaw: Array) -> Array:
        """Return the constraint violations (m, c), as fractions of limits' sizes, for a yaw (4, m).

        Where the path without yaw exceeds a limit less its reserve, the path's value replaces the limit.
        """
        return np.asarray(self._values(yaw) - self._ends)

    def slopes(self, yaw: Array) -> Array:
        """Return the slopes of `excess` by the yaw and its derivatives, (4, m, c)."""
        found = []
        for step in DIFFERENCE * np.eye(ORDERS)[..., None]:
            found.append((self._values(yaw + step) - self._values(yaw - step)) / (2 * DIFFERENCE))
        return np.array(found)

    @cached_property
    def _limits(self) -> tuple[Limit, ...]:
        return tuple(limit for limit in self.task.limits if not limit.quantity.is_of_path)

    @cached_property
    def _weights(self) -> Array:
        """The weights on the measures for the upper ends of all limits, then for the lower ones, (c, 11)."""
        rows = [limit.quantity.measured / limit.size for limit in self._limits]
        measured = np.array(rows).reshape(-1, MEASURES)
        return np.concatenate([measured, -measured])

    @cached_property
    def _ends(self) -> Array:
        lower, upper = np.array([limit.ends for limit in self._limits]).reshape(-1, 2).T
        keep = np.array([limit.reserves(self.task.reserve) for limit in self._limits])
        ends = np.concatenate([upper - keep[:, 1], -lower - keep[:, 0]])
        return np.asarray(np.maximum(ends, self._values(np.zeros((ORDERS, len(self.times))))))

    def _values(self, yaw: Array) -> Array:
        return np.asarray(self._measures(yaw) @ self._weights.T)

    def _measures(self, yaw: Array) -> Array:
        """Return the measures of `limits.quantity`, (m, 11)."""
        angle, rate, acceleration, jerk = yaw
        cosine, sine = np.cos(angle), np.sin(angle)
        still, first, second = ((cosine * x + sine * y, cosine * y - sine * x) for x, y, _ in self._turning)
        omega, omega_dot = kernel.spun((*still, 0.0), (*first, 0.0), (rate, acceleration))
        angular_jerk = (
            second[0] + 2 * rate * first[1] + acceleration * still[1] - rate**2 * still[0],
            second[1] - 2 * rate * first[0] - acceleration * still[0] - rate**2 * still[1],
            jerk,
        )
        moment, moment_rate = kernel.moment_and_rate(
            self.task.vehicle.inertia.tolist(), omega, omega_dot, angular_jerk
        )
        thrust, thrust_rate, norm, upright = self._untouched
        spinning = np.sqrt(dot(omega, omega))
        found = (thrust, *moment, thrust_rate, *moment_rate, norm, spinning, upright)
        assert len(found) == MEASURES
        return np.stack(found, axis=-1)

    @cached_property
    def _motion(self) -> tuple[Array, Array]:
        """Air velocity and acceleration, (m, 2, 3), and f to f''', (m, 4, 3), in body axes without yaw."""
        v, a, j, s, c = (self.path.evaluate(self.times, k) for k in range(1, 6))
        environment, drag = self.task.environment, lateral_drag(self.task.vehicle)
        air = v - environment.wind
        thrust = (a + drag * air + environment.weight, j + drag * a, s + drag * j, c + drag * s)
        axes = so3.axes(self.carried.q_world_body)
        return np.stack([air, a], axis=1) @ axes, np.stack(thrust, axis=1) @ axes

    @cached_property
    def _turning(self) -> tuple[tuple[Array, Array, Array], ...]:
        thrust = self._motion[1] / np.linalg.norm(self._motion[1][:, :1], axis=-1, keepdims=True)
        b3, *rates = (xyz(thrust[:, k]) for k in range(4))
        return kernel.turning(b3, *rates)

    @cached_property
    def _untouched(self) -> tuple[Array, ...]:
        """Collective thrust and its rate, |f|, and the cosine of the tilt, which do not depend on the yaw."""
        vehicle, (air, thrust) = self.task.vehicle, self._motion
        norm = np.linalg.norm(thrust[:, 0], axis=-1)
        b3 = xyz(thrust[:, 0] / norm[:, None])
        axial = axial_drag(vehicle)
        collective = kernel.collective(vehicle.mass, axial, norm, b3, xyz(air[:, 0]))
        beside = xyz(air[:, 0]), xyz(air[:, 1])
        rate = kernel.collective_rate(vehicle.mass, axial, b3, (norm, xyz(thrust[:, 1])), beside)
        return collective, rate, norm, so3.thrust_axis(self.carried.q_world_body)[:, 2]
