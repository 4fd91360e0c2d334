"""Limits along a path as constraints with their slopes: what the refinement of the search's paths holds.

Measures are taken in body axes that are carried with the thrust axis by the smallest rotation from those of
the path as it is: exact where the path is met, and exact to first order beside it. Slopes come from a complex
step, which knows no cancellation (Squire and Trapp, "Using complex variables to estimate derivatives of real
functions", 1998).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from typing import Any

import numpy as np

from aerobat import so3
from aerobat.arrays import Array, Indices, Mask, xyz
from aerobat.environment import Environment
from aerobat.flatness import axial_drag, has_unequal_drag, lateral_drag, reference_of
from aerobat.flatness.parallel_transport import frames
from aerobat.flatness.references import UNDETERMINED, specific_thrust
from aerobat.kernels import flatness as kernel
from aerobat.kernels import unequal_drag
from aerobat.kernels.ops import Vector
from aerobat.kernels.vectors import dot, scale
from aerobat.limits import MEASURES, Limit
from aerobat.so3 import UP
from aerobat.states import FlatState
from aerobat.vehicle import Vehicle

COMPLEX_STEP = 1e-20
TINY = 1e-18  # [rad²/s²] beside the square of a rate, which a body at rest has with a slope
MOVING = slice(1, 6)  # velocity to crackle: what measures depend on


@dataclass(frozen=True, eq=False)
class LimitRows:
    """Constraints c ≤ 0 on a path's derivatives, each as a fraction of its limit's size."""

    limits: tuple[Limit, ...]
    vehicle: Vehicle
    environment: Environment
    heading: float  # [rad]

    @cached_property
    def sides(self) -> tuple[tuple[Limit, float], ...]:
        """The limit of each constraint, with -1 for its lower end and 1 for its upper one."""
        return tuple(
            (limit, sign)
            for limit in self.limits
            for sign, end in zip((-1.0, 1.0), limit.ends, strict=True)
            if isfinite(end)
        )

    @cached_property
    def of_path(self) -> Mask:
        """Which constraints are linear in the path's derivatives, (c,)."""
        return np.array([limit.quantity.is_of_path for limit, _ in self.sides], dtype=bool)

    @cached_property
    def has_reserve(self) -> Mask:
        """Which constraints a reserve for the controller is kept from, (c,)."""
        return np.array([limit.has_reserve for limit, _ in self.sides], dtype=bool)

    def frames(self, times: Array, derivatives: Array) -> Array:
        """Body axes in the world, as columns, (m, 3, 3), along a path's derivatives (m, 6, 3)."""
        position, velocity, acceleration, jerk, snap = np.moveaxis(derivatives[:, :5], 1, 0)
        if has_unequal_drag(self.vehicle):
            flat = FlatState(position, velocity, acceleration, jerk, snap)
            found = reference_of(times, flat, self.vehicle, self.environment, self.heading)
            return so3.axes(found.setpoint.q_world_body)
        airspeed = velocity - self.environment.wind
        thrust = specific_thrust(self.vehicle, self.environment, airspeed, acceleration, jerk, snap)
        path = frames(times, thrust, UNDETERMINED * self.environment.gravity, self.heading)
        return so3.axes(path.q_world_body[path.samples])

    def values(self, derivatives: Array, frames: Array) -> Array:
        """The constraints at derivatives (m, 6, 3), (m, c), infinite where thrust is against its frame."""
        with np.errstate(divide="ignore", invalid="ignore"):
            measures = self._measures(self._moving(derivatives) @ frames, frames)
            values = measures @ self._measured.T
        values[:, self.of_path] = np.einsum("mka,cka->mc", derivatives, self._path[self.of_path])
        values -= self._bounds
        return np.where(np.isnan(values), np.inf, values)

    def slopes(self, derivatives: Array, frames: Array, place: Indices, column: Indices) -> Array:
        """Slopes of some constraints by the derivatives at their places, (q, 6, 3).

        Args:
            derivatives: Of the path, (m, 6, 3).
            frames: Body axes there, (m, 3, 3).
            place: Where each of the constraints is looked at, (q,).
            column: Which one it is, (q,).
        """
        slopes = self._path[column]
        of_measures = ~self.of_path[column]
        place, column = place[of_measures], column[of_measures]
        looked_at = np.zeros(len(frames), dtype=bool)
        looked_at[place] = True
        frames = frames[looked_at]
        local = self._moving(derivatives[looked_at]) @ frames
        directions = np.eye(15).reshape(15, 1, 5, 3)
        measures = self._measures(local + 1j * COMPLEX_STEP * directions, frames)
        by_local = np.moveaxis(measures.imag / COMPLEX_STEP, 0, -1).reshape(*measures.shape[1:], 5, 3)
        by_world = (by_local @ np.swapaxes(frames, -1, -2)[:, None]).reshape(*measures.shape[1:], 15)
        index = looked_at.cumsum()[place] - 1
        along = (self._measured[column, None] @ by_world[index]).reshape(len(place), 5, 3)
        slopes[np.flatnonzero(of_measures)[:, None], np.arange(6)[MOVING]] = along
        return slopes

    @cached_property
    def _measured(self) -> Array:
        """Weights on the measures, (c, 11)."""
        rows = [sign / limit.size * limit.quantity.measured for limit, sign in self.sides]
        return np.array(rows).reshape(-1, MEASURES)

    @cached_property
    def _path(self) -> Array:
        """Weights on the path's derivatives, (c, 6, 3)."""
        rows = [sign / limit.size * limit.quantity.path for limit, sign in self.sides]
        return np.array(rows).reshape(-1, 6, 3)

    @cached_property
    def _bounds(self) -> Array:
        """The ends that weighted values keep below, (c,)."""
        return np.array([sign * limit.ends[int(sign > 0.0)] for limit, sign in self.sides])

    def _moving(self, derivatives: Array) -> Array:
        """Airspeed, acceleration, jerk, snap and crackle, (m, 5, 3)."""
        moving = derivatives[:, MOVING].copy()
        moving[:, 0] -= self.environment.wind
        return moving

    def _measures(self, moving: Any, frames: Array) -> Any:
        """The measures of airspeed to crackle in body axes (..., m, 5, 3), (..., m, 11)."""
        if has_unequal_drag(self.vehicle):
            return self._unequal_measures(moving, frames)
        drag = lateral_drag(self.vehicle)
        airspeed, acceleration, jerk, snap, crackle = np.moveaxis(moving, -2, 0)
        weight = self.environment.weight @ frames
        f, f1, f2 = kernel.specific_thrust(weight, drag, airspeed, acceleration, jerk, snap)
        vectors = [xyz(x) for x in (f, f1, f2, crackle + drag * snap, airspeed, acceleration)]
        norm = np.sqrt(dot(vectors[0], vectors[0]))
        b3, *rates = (scale(1.0 / norm, vector) for vector in vectors[:4])
        turning = kernel.turning(b3, *rates)
        rate = np.sqrt(dot(turning[0], turning[0]) + TINY)
        upright = dot(b3, xyz(UP @ frames))
        return np.stack([*self._wrenches(b3, norm, vectors, turning), norm, rate, upright], axis=-1)

    def _unequal_measures(self, moving: Any, frames: Array) -> Any:
        """The same, of drag that differs along body x and y."""
        vectors = [xyz(x) for x in (self.environment.weight @ frames, *np.moveaxis(moving, -2, 0))]
        vehicle = self.vehicle
        drag = tuple((vehicle.drag_body / vehicle.mass).tolist())
        airframe = unequal_drag.DraggedBody(vehicle.mass, drag, vehicle.inertia.tolist())
        asked = unequal_drag.demand(np.sqrt, airframe, unequal_drag.BodyMotion(*vectors))
        rate = np.sqrt(dot(asked.omega, asked.omega) + TINY)
        upright = dot(asked.b3, xyz(UP @ frames))
        return np.stack([*asked.wrench, *asked.rate, asked.specific_thrust, rate, upright], axis=-1)

    def _wrenches(
        self, b3: Vector, norm: Any, vectors: list[Vector], turning: tuple[Vector, ...]
    ) -> tuple[Any, ...]:
        """Collective thrust and moment, then their derivatives, (..., m) each.

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
        moment, moment_rate = kernel.moment_and_rate(inertia, *local)
        return thrust, *moment, thrust_rate, *moment_rate


def stage_rows(limit: Limit) -> Iterator[tuple[Array, float]]:
    """Yield a linear limit's sides as weights (6, 3) and the bound that they keep below."""
    for sign, end in zip((-1.0, 1.0), limit.ends, strict=True):
        if isfinite(end):
            yield sign / limit.size * limit.quantity.path, sign * end
