"""What limits are linear in along a polynomial path, in CasADi's symbols, by `kernels.flatness`.

In a vertical plane the body turns about one axis of its own. In space its axes are those of a guess, carried
from the guess's thrust direction to the new one by the smallest rotation: exact where the guess is met.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.environment import Environment
from aerobat.flatness import axial_drag, has_unequal_drag, lateral_drag, reference
from aerobat.kernels import flatness as kernel
from aerobat.kernels import unequal_drag
from aerobat.kernels.ops import Vector
from aerobat.kernels.quaternions import to_body
from aerobat.kernels.vectors import dot, scale
from aerobat.limits import Limit
from aerobat.limits.quantity import BODY_RATE, SPECIFIC_THRUST, WRENCH, WRENCH_RATE
from aerobat.optimization.nonlinear import import_casadi
from aerobat.so3 import UP
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

SAME = 1e-9  # relative differences between limits that mean nothing


@dataclass(frozen=True, eq=False)
class SymbolicMeasures:
    """The measures that limits are linear in, of a vehicle's motion along axes.

    In a vertical plane collective thrust, angular acceleration and squared rate make the wrench. Drag that
    differs along body x and y turns a body out of such a plane: then motion has three axes.
    """

    vehicle: Vehicle
    axes: Array  # of motion, orthonormal columns, (3, d); d = 2: in a vertical plane, the second up
    environment: Environment
    heading: float  # [rad]

    @property
    def frame_size(self) -> int:
        """The number of components of a frame."""
        return 3 if self._planar else 9

    def distinct(self, limits: Sequence[Limit]) -> tuple[Limit, ...]:
        """Return limits on measures without those that are the same here: rotors that turn a plane alike."""
        rows = []
        for limit in limits:
            wrench, rate, others = np.split(limit.quantity.measured, [WRENCH.stop, WRENCH_RATE.stop])
            rows.append([*(wrench @ self._to_wrench), *(rate @ self._to_wrench), *others, *limit.ends])
        table = np.nan_to_num(np.array(rows).reshape(len(limits), -1), posinf=0.0, neginf=0.0)
        scaled = np.round(table / np.maximum(np.abs(table).max(axis=0, initial=0.0), SAME) / SAME)
        first = np.sort(np.unique(scaled, axis=0, return_index=True)[1])
        return tuple(limits[i] for i in first)

    def frames(self, trajectory: Trajectory, times: Array) -> Array:
        """Body axes in the world along a trajectory, (9, n): x, y and z; or the axis of turning, (3, n)."""
        if self._planar:
            return np.repeat(self._turning_axis[:, None], len(times), axis=1)
        q = reference(trajectory, self.vehicle, times, environment=self.environment).setpoint.q_world_body
        return np.swapaxes(so3.axes(q), -1, -2).reshape(len(times), 9).T

    def values(self, limits: Sequence[Limit], motion: list[Any], frame: Any) -> Any:
        """Return the quantities of limits over their sizes, magnitudes squared, a column.

        Args:
            limits: Of measures.
            motion: Velocity to crackle, (d,) each.
            frame: The body axes of the guess.
        """
        ca = import_casadi()
        v, a, j, s, crackle = motion
        airspeed = v - ca.DM(self.environment.wind @ self.axes)
        if has_unequal_drag(self.vehicle):
            return self._unequal_values(limits, [airspeed, a, j, s, crackle], frame)
        weight = ca.DM(self.environment.weight @ self.axes)
        thrusts = kernel.specific_thrust(weight, lateral_drag(self.vehicle), airspeed, a, j, s)
        vectors = (*thrusts, airspeed, ca.DM(UP @ self.axes))
        f, jerk, snap, airspeed, up = (self._local(vector, frame) for vector in vectors)
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
        loads = ca.vertcat(collective, turning)
        rates = ca.SX(*loads.shape)
        if any(limit.quantity.measured[WRENCH_RATE].any() for limit in limits):
            rates = ca.jtimes(loads, ca.vertcat(v, a, j, s), ca.vertcat(a, j, s, crackle))
        to_wrench = ca.sparsify(ca.DM(self._to_wrench))
        measures = ca.vertcat(
            to_wrench @ loads, to_wrench @ rates, n, ca.sqrt(dot(omega, omega)), dot(b3, up)
        )
        squares = {SPECIFIC_THRUST: squared, BODY_RATE: dot(omega, omega)}
        return self._weighted(limits, measures, squares)

    def _unequal_values(self, limits: Sequence[Limit], motion: list[Any], frame: Any) -> Any:
        """The same in space, of drag that differs along body x and y, from the airspeed to crackle."""
        ca, vehicle = import_casadi(), self.vehicle
        vectors = (ca.DM(self.environment.weight @ self.axes), *motion, ca.DM(UP @ self.axes))
        *local, up = (self._local(vector, frame) for vector in vectors)
        drag = tuple((vehicle.drag_body / vehicle.mass).tolist())
        airframe = unequal_drag.DraggedBody(vehicle.mass, drag, vehicle.inertia.tolist())
        asked = unequal_drag.demand(ca.sqrt, airframe, unequal_drag.BodyMotion(*local))
        squares = {SPECIFIC_THRUST: asked.specific_thrust**2, BODY_RATE: dot(asked.omega, asked.omega)}
        plain = asked.specific_thrust, ca.sqrt(squares[BODY_RATE]), dot(asked.b3, up)
        return self._weighted(limits, ca.vertcat(*asked.wrench, *asked.rate, *plain), squares)

    def _weighted(self, limits: Sequence[Limit], measures: Any, squares: dict[int, Any]) -> Any:
        """What limits weigh of measures over their sizes, magnitudes by their squares."""
        ca = import_casadi()
        values = []
        for limit in limits:
            magnitude, weights = limit.quantity.magnitude, limit.quantity.measured / limit.size
            if magnitude is not None:
                values.append(weights[magnitude] ** 2 * squares[magnitude])
            else:
                values.append(ca.dot(ca.sparsify(ca.DM(weights)), measures))
        return ca.vertcat(*values)

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
    def _to_wrench(self) -> Array:
        """The map from what makes the wrench to the wrench, (4, 4); in a plane (4, 3)."""
        if not self._planar:
            return np.eye(4)
        axis, inertia = self._turning_axis, self.vehicle.inertia
        moments = np.stack([inertia @ axis, np.cross(axis, inertia @ axis)], axis=1)
        return np.vstack([[1.0, 0.0, 0.0], np.hstack([np.zeros((3, 1)), moments])])

    def _local(self, vector: Any, frame: Any) -> Vector:
        """Components of a vector in the guess's body axes; in a plane in its own, the third across it."""
        if self._planar:
            return vector[0], vector[1], 0.0
        x, y, z = ((frame[k], frame[k + 1], frame[k + 2]) for k in (0, 3, 6))
        return to_body((x, y, z), (vector[0], vector[1], vector[2]))
