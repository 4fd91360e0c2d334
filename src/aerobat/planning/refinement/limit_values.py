"""Limits along a path as constraints with their first and second derivatives, compiled once a vehicle.

Measures are taken in body axes that are carried with the thrust axis by the smallest rotation from those of a
path nearby: exact where that is met, and exact to first order beside it, but for the angle about the axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isfinite

import numpy as np

from aerobat import so3
from aerobat.arrays import Array, Mask
from aerobat.engines.array_functions import COMPLEX_STEP, ArrayFunction, array_function, gradient
from aerobat.engines.tracing import Trace, TraceOps
from aerobat.flatness import axial_drag, has_unequal_drag, lateral_drag, reference_of
from aerobat.flatness.parallel_transport import frames
from aerobat.flatness.references import UNDETERMINED, specific_thrust
from aerobat.kernels.measures import InertiaAndDrag, measures
from aerobat.kernels.unequal_drag import BodyMotion
from aerobat.limits import MEASURES, Limit, clearance
from aerobat.limits.clearance import Planes
from aerobat.planning.refinement.clearance_values import MOVED, ClearanceValues
from aerobat.planning.task import Task
from aerobat.so3 import UP
from aerobat.states import FlatState

MOVING = slice(1, 6)  # velocity to crackle: what measures depend on
MOTION = 15  # their components


@dataclass(frozen=True, eq=False)
class Frames:
    """Body axes of a path nearby, as columns, and what is known in them."""

    axes: Array  # (m, 3, 3)
    weight: Array  # gravity's reaction over mass in them [m/s²], (m, 3)
    up: Array  # (m, 3)
    planes: Planes | None  # between body and obstacles, where there are any


@dataclass(frozen=True, eq=False)
class LimitValues:
    """Constraints c ≤ 0 on a path's derivatives, each as a fraction of its limit's size.

    Those of held limits, then those of clearances from the obstacles that are nearest at a place.
    """

    task: Task

    @cached_property
    def sides(self) -> tuple[tuple[Limit, float], ...]:
        """The limit of each constraint, with -1 for its lower end and 1 for its upper one."""
        clear = (clearance.limit(self.task.clearance), -1.0)
        return (*self._held, *([clear] * self.clearances.count))

    @cached_property
    def clearances(self) -> ClearanceValues:
        """The constraints of clearances."""
        return ClearanceValues(self.task)

    @cached_property
    def _held(self) -> tuple[tuple[Limit, float], ...]:
        return tuple(
            (limit, sign)
            for limit in self.task.held
            for sign, end in zip((-1.0, 1.0), limit.ends, strict=True)
            if isfinite(end)
        )

    @cached_property
    def of_path(self) -> Mask:
        """The mask of the constraints that are linear in the path's derivatives, (c,)."""
        return self.at_ends & (np.arange(len(self.sides)) < len(self._held))

    @cached_property
    def at_ends(self) -> Mask:
        """The mask of the constraints that are decided at ends, whose path is fixed, (c,)."""
        return np.array([limit.quantity.is_of_path for limit, _ in self.sides], dtype=bool)

    @cached_property
    def reserve(self) -> Array:
        """The reserve for the controller that is kept from each, as a fraction of its limit's size, (c,)."""
        return np.array([limit.kept(self.task.reserve)[sign > 0.0] for limit, sign in self.sides])

    def frames(self, times: Array, derivatives: Array) -> Frames:
        """Body axes along a path's derivatives (m, 6, 3) at times (m,)."""
        axes = self._axes(times, derivatives)
        planes = self.clearances.planes(times, derivatives) if self.clearances.count else None
        return Frames(axes, self.task.environment.weight @ axes, UP @ axes, planes)

    def values(self, derivatives: Array, near: Frames) -> Array:
        """The constraints at derivatives (m, 6, 3), (m, c), infinite where thrust is against its frame."""
        with np.errstate(divide="ignore", invalid="ignore"):
            moving = self._local(derivatives, near)
            found = self._functions[0]([*moving, *near.weight.T, *near.up.T])
            values = _columns(found, len(derivatives)) @ self._measured.T
        values[:, self._linear] = np.tensordot(derivatives, self._path[self._linear], ([1, 2], [1, 2]))
        values -= self._bounds
        values = np.where(np.isnan(values), np.inf, values)
        if near.planes is None:
            return values
        return np.concatenate([values, self.clearances.values(derivatives, near.planes)], axis=1)

    def slopes(self, derivatives: Array, near: Frames) -> Array:
        """The constraints' slopes by the derivatives, (m, c, 6, 3)."""
        moving = self._stepped(self._local(derivatives, near))
        with np.errstate(divide="ignore", invalid="ignore"):
            found = self._functions[0]([*moving, *near.weight.T, *near.up.T])
        count = len(derivatives)
        by_local = np.array([np.broadcast_to(each, (MOTION, count)).imag for each in found]) / COMPLEX_STEP
        weighted = np.tensordot(self._measured, by_local, 1).transpose(2, 0, 1)
        slopes = np.zeros((count, len(self._held), 6, 3))
        local = weighted.reshape(count, -1, 5, 3)
        slopes[:, :, MOVING] = local @ np.swapaxes(near.axes, 1, 2)[:, None]
        slopes[:, self._linear] = self._path[self._linear]
        if near.planes is None:
            return slopes
        return np.concatenate([slopes, self.clearances.slopes(derivatives, near.planes)], axis=1)

    def curvature(self, derivatives: Array, near: Frames, weights: Array) -> tuple[Array, Array]:
        """The weighted constraints' slopes (m, 6, 3), and second derivatives by velocity to crackle.

        Args:
            derivatives: Of the path, (m, 6, 3).
            near: The frames.
            weights: Of the constraints, (m, c).

        Returns:
            The slopes (m, 6, 3), and the second derivatives (m, 15, 15).
        """
        count, weights, beside = len(derivatives), *np.split(weights, [len(self._held)], axis=1)
        by_measure = weights @ self._measured
        moving = self._stepped(self._local(derivatives, near))
        with np.errstate(divide="ignore", invalid="ignore"):
            found = self._functions[1]([*moving, *near.weight.T, *near.up.T, *by_measure.T])
        gradients = np.array([np.broadcast_to(each, (MOTION, count)) for each in found])
        slopes = np.tensordot(weights[:, self._linear], self._path[self._linear], 1)
        turned = gradients[:, 0].real.T.reshape(count, 5, 3) @ np.swapaxes(near.axes, 1, 2)
        slopes[:, MOVING] += turned
        second = (gradients.imag / COMPLEX_STEP).transpose(2, 1, 0).reshape(count, 5, 3, 5, 3)
        back = np.swapaxes(near.axes, 1, 2)[:, None]
        second = second.reshape(count, -1, 3) @ back.reshape(count, 3, 3)
        second = second.reshape(count, 5, 3, -1).swapaxes(2, 3)
        second = (second.reshape(count, -1, 3) @ back.reshape(count, 3, 3)).reshape(count, 5, MOTION, 3)
        second = second.swapaxes(2, 3).reshape(count, MOTION, MOTION)
        if near.planes is not None:
            more_slopes, bent = self.clearances.curvature(derivatives, near.planes, beside)
            slopes += more_slopes
            second[:, :MOVED, :MOVED] += bent
        return slopes, second

    def _local(self, derivatives: Array, near: Frames) -> Array:
        """Airspeed, acceleration, jerk, snap and crackle in body axes, (15, m)."""
        moving = derivatives[:, MOVING].copy()
        moving[:, 0] -= self.task.environment.wind
        return np.asarray((moving @ near.axes).reshape(len(derivatives), MOTION).T)

    def _stepped(self, moving: Array) -> Array:
        """The same, (15, m), with each component in turn moved by a complex step, (15, 15, m)."""
        stepped = np.repeat(moving[:, None], MOTION, axis=1).astype(complex)
        each = np.arange(MOTION)
        stepped[each, each] += 1j * COMPLEX_STEP
        return stepped

    def _axes(self, times: Array, derivatives: Array) -> Array:
        """Body axes in the world, as columns, (m, 3, 3)."""
        vehicle, environment = self.task.vehicle, self.task.environment
        heading = self.task.problem.heading.start
        position, velocity, acceleration, jerk, snap = np.moveaxis(derivatives[:, :5], 1, 0)
        if has_unequal_drag(vehicle):
            flat = FlatState(position, velocity, acceleration, jerk, snap)
            found = reference_of(times, flat, vehicle, environment, heading)
            return so3.axes(found.setpoint.q_world_body)
        airspeed = velocity - environment.wind
        thrust = specific_thrust(vehicle, environment, airspeed, acceleration, jerk, snap)
        path = frames(times, thrust, UNDETERMINED * environment.gravity, heading)
        return so3.axes(path.q_world_body[path.samples])

    @cached_property
    def _functions(self) -> tuple[ArrayFunction, ArrayFunction]:
        """Measures of a motion, weight and vertical; slopes by the motion of their weighted sum."""
        trace = Trace()
        moving = BodyMotion(*map(trace.vector, BodyMotion._fields))
        up = trace.vector("up")
        weights = [trace.input(f"weights {i}") for i in range(MEASURES)]
        found = measures(TraceOps(trace), self._airframe, moving, up)
        outputs = [trace.symbol(value) for value in found]
        total = trace.symbol(sum(w * value for w, value in zip(weights, outputs, strict=True)))
        motion = [component for vector in moving[1:] for component in vector]
        given = [*motion, *moving.weight, *up]
        return array_function(given, outputs), array_function([*given, *weights], gradient(total, motion))

    @property
    def _airframe(self) -> InertiaAndDrag:
        vehicle = self.task.vehicle
        unequal = tuple((vehicle.drag_body / vehicle.mass).tolist()) if has_unequal_drag(vehicle) else None
        return InertiaAndDrag(
            vehicle.mass, vehicle.inertia.tolist(), lateral_drag(vehicle), axial_drag(vehicle), unequal
        )

    @cached_property
    def _measured(self) -> Array:
        """Weights on the measures, (c, 11)."""
        rows = [sign / limit.size * limit.quantity.measured for limit, sign in self._held]
        return np.array(rows).reshape(-1, MEASURES)

    @cached_property
    def _linear(self) -> Mask:
        """The mask of the held limits that are linear in the path's derivatives."""
        return self.of_path[: len(self._held)]

    @cached_property
    def _path(self) -> Array:
        """Weights on the path's derivatives, (c, 6, 3)."""
        rows = [sign / limit.size * limit.quantity.path for limit, sign in self._held]
        return np.array(rows).reshape(-1, 6, 3)

    @cached_property
    def _bounds(self) -> Array:
        """The ends that weighted values keep below, (c,)."""
        return np.array([sign * limit.ends[int(sign > 0.0)] for limit, sign in self._held])


def _columns(found: tuple[Array, ...], count: int) -> Array:
    """Arrays, or single numbers, as columns, (m, 11)."""
    return np.stack([np.broadcast_to(each, (count,)) for each in found], axis=-1)
