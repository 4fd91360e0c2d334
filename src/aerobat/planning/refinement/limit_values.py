"""Limits along a path as constraints with first and second derivatives, compiled to machine code.

Measures are taken in body axes. These follow from the body axes of a nearby path by the smallest rotation
that moves the thrust axis. They are exact on the nearby path. Beside it, they are exact to first order,
except for the angle about the thrust axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import isfinite

import numpy as np

from aerobat import so3
from aerobat.arrays import Array, Mask
from aerobat.engines.llvm.functions import NO_DIRECTION, SmoothFunctions, smooth_functions, triples
from aerobat.flatness import axial_drag, has_unequal_drag, lateral_drag, reference_of
from aerobat.flatness.inverse_dynamics import UNDETERMINED, specific_thrust
from aerobat.flatness.parallel_transport import frames
from aerobat.kernels.measures import InertiaAndDrag, measures
from aerobat.kernels.ops import Ops, Scalar
from aerobat.kernels.quaternions import to_body
from aerobat.kernels.unequal_drag import BodyMotion
from aerobat.kernels.vectors import add_scaled
from aerobat.limits import MEASURES, Limit, clearance
from aerobat.limits.clearance import Planes
from aerobat.planning.refinement.clearance_values import MOVED, ClearanceValues
from aerobat.planning.task import Task
from aerobat.states import FlatState

MOVING = slice(1, 6)  # velocity to crackle, on which measures depend
MOTION = 15  # number of their components
DIRECTIONS = np.eye(MOTION)


@dataclass(frozen=True, eq=False)
class Frames:
    """Body axes along a nearby path, and the planes that separate its body from obstacles."""

    axes: Array  # body axes in the world, as columns, (m, 3, 3)
    planes: Planes | None  # between body and obstacles; None without obstacles

    @cached_property
    def triads(self) -> Array:
        """The three axes of each place one after another, (m, 9)."""
        return np.swapaxes(self.axes, 1, 2).reshape(-1, 9)


@dataclass(frozen=True, eq=False)
class LimitValues:
    """Constraints c ≤ 0 on a path's derivatives, each as a fraction of its limit's size.

    First come the finite ends of all limits, then the clearances from the nearest obstacles at each place.
    """

    task: Task

    @cached_property
    def sides(self) -> tuple[tuple[Limit, float], ...]:
        """The limit of each constraint, and its end: -1 for the lower, 1 for the upper end."""
        clear = (clearance.limit(self.task.clearance), -1.0)
        return (*self._held, *([clear] * self.clearances.count))

    @cached_property
    def clearances(self) -> ClearanceValues:
        """The clearance constraints."""
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
    def at_ends(self) -> Mask:
        """The masks of the constraints that the fixed derivatives decide at start and goal, (2, c).

        The jerk is not fixed there, so limits on it are not decided. A closed course has no ends.
        """
        quantities = [limit.quantity for limit, _ in self.sides]
        fixed = [state.asked.tolist() for state in self.task.problem.ends.values()]
        masks = [
            [each.is_of_path and {*each.derivatives} <= {*known} for each in quantities] for known in fixed
        ]
        return np.array(masks or np.zeros((2, len(quantities))), dtype=bool)

    @cached_property
    def reserve(self) -> Array:
        """The reserve for the controller in each constraint, as a fraction of its limit's size, (c,)."""
        return np.array([limit.reserves(self.task.reserve)[sign > 0.0] for limit, sign in self.sides])

    def frames(self, times: Array, derivatives: Array) -> Frames:
        """Return the body axes and planes of a path with derivatives (m, 6, 3) at times (m,)."""
        axes = self._axes(times, derivatives)
        planes = self.clearances.planes(times, derivatives) if self.clearances.count else None
        return Frames(axes, planes)

    def values(self, derivatives: Array, near: Frames) -> Array:
        """Return the constraints (m, c) at derivatives (m, 6, 3).

        Values are infinite where the thrust is opposite to the thrust axis of its frame.
        """
        found = self._functions.values(self._shared, self._inputs(derivatives, near), NO_DIRECTION)
        with np.errstate(invalid="ignore"):
            values = np.asarray(found[0].T @ self.measured.T)
        values[:, self.linear] = derivatives.reshape(-1, 18) @ self.path.T
        values -= self._bounds
        values[np.isnan(values)] = np.inf
        if near.planes is None:
            return values
        return np.concatenate([values, self.clearances.values(derivatives, near.planes)], axis=1)

    def slopes(self, derivatives: Array, near: Frames) -> LimitSlopes:
        """Return the constraints' slopes by the derivatives (m, 6, 3)."""
        found = self._functions.slopes(self._shared, self._inputs(derivatives, near), DIRECTIONS)
        beside = None if near.planes is None else self.clearances.slopes(derivatives, near.planes)
        return LimitSlopes(self, found.transpose(2, 1, 0), beside)

    def curvature(self, derivatives: Array, near: Frames, weights: Array, squares: Array) -> Array:
        """Return the Hessian of Σ weights · c plus Jᵀ diag(squares) J, by position to crackle, (m, 18, 18).

        J is the Jacobian of the constraints.

        Args:
            derivatives: Derivatives of the path, (m, 6, 3).
            near: Frames of the nearby path.
            weights: Weights of the constraints, (m, c).
            squares: Weights of the squared slopes, (m, c).
        """
        held = len(self._held)
        of_measures = weights[:, :held] @ self.measured, squares[:, :held] @ self._products
        inputs = self._inputs(derivatives, near, *of_measures)
        second = (squares[:, :held][:, self.linear] @ self._path_products).reshape(-1, 18, 18)
        second[:, 3:, 3:] += self._functions.curvature(self._shared, inputs, DIRECTIONS).transpose(2, 1, 0)
        if near.planes is not None:
            beside = self.clearances.slopes(derivatives, near.planes).reshape(len(derivatives), -1, 18)
            second += np.swapaxes(beside, 1, 2) @ (squares[:, held:, None] * beside)
            bent = self.clearances.curvature(derivatives, near.planes, weights[:, held:])
            second[:, 3 : 3 + MOVED, 3 : 3 + MOVED] += bent
        return second

    def _inputs(self, derivatives: Array, near: Frames, *more: Array) -> Array:
        """Return the functions' inputs: velocity to crackle, body axes, then `more`, (m, 24 or more)."""
        motion = derivatives.reshape(-1, 18)[:, -MOTION:]
        return np.concatenate([motion, near.triads, *more], axis=1)

    def _axes(self, times: Array, derivatives: Array) -> Array:
        """Return the body axes in the world, as columns, (m, 3, 3)."""
        vehicle, environment = self.task.vehicle, self.task.environment
        heading = self.task.problem.heading.start
        flat = FlatState(*np.moveaxis(derivatives[:, :5], 1, 0))
        if has_unequal_drag(vehicle):
            found = reference_of(times, flat, vehicle, environment, heading)
            return so3.axes(found.setpoint.q_world_body)
        thrust = specific_thrust(flat, vehicle, environment)
        path = frames(times, thrust, UNDETERMINED * environment.gravity, heading)
        return so3.axes(path.q_world_body[path.samples])

    @cached_property
    def _functions(self) -> SmoothFunctions:
        """The compiled measures for the vehicle's kind of drag."""
        return measure_functions(has_unequal_drag(self.task.vehicle))

    @cached_property
    def _shared(self) -> Array:
        """Weight, wind, and the vehicle's inertia, drag and mass, as `measure_functions` take them."""
        vehicle, environment = self.task.vehicle, self.task.environment
        air, drag = [*environment.weight, *environment.wind], vehicle.drag_body / vehicle.mass
        others = vehicle.mass, lateral_drag(vehicle), axial_drag(vehicle)
        return np.array([*air, *vehicle.inertia.ravel(), *drag, *others])

    @cached_property
    def measured(self) -> Array:
        """The weights of each constraint on the measures, (c, 11)."""
        rows = [sign / limit.size * limit.quantity.measured for limit, sign in self._held]
        return np.array(rows).reshape(-1, MEASURES)

    @cached_property
    def _products(self) -> Array:
        """The products of each constraint's weights, the upper triangle with the diagonal, (c, 66)."""
        i, j = np.triu_indices(MEASURES)
        return np.asarray(self.measured[:, i] * self.measured[:, j])

    @cached_property
    def linear(self) -> Mask:
        """The mask, without clearances, of the constraints that are linear in the path's derivatives."""
        return np.array([limit.quantity.is_of_path for limit, _ in self._held], dtype=bool)

    @cached_property
    def path(self) -> Array:
        """The weights of the constraints that are linear in the path's derivatives, (l, 18)."""
        rows = [sign / limit.size * limit.quantity.path for limit, sign in self._held]
        return np.array(rows).reshape(-1, 18)[self.linear]

    @cached_property
    def _path_products(self) -> Array:
        """The outer products of these weights with themselves, (l, 324)."""
        return np.asarray((self.path[:, :, None] * self.path[:, None]).reshape(-1, 18 * 18))

    @cached_property
    def _bounds(self) -> Array:
        """The upper bounds of the weighted values, (c,)."""
        return np.array([sign * limit.ends[int(sign > 0.0)] for limit, sign in self._held])


@dataclass(frozen=True, eq=False)
class LimitSlopes:
    """Slopes of constraints by a path's derivatives (m, 6, 3)."""

    limits: LimitValues
    measures: Array  # slopes of the measures by velocity to crackle, (m, 11, 15)
    beside: Array | None  # slopes of clearances, (m, NEAREST, 6, 3)

    def along(self, change: Array) -> Array:
        """Return the change (m, c) of the constraints along a change of the derivatives (m, 6, 3)."""
        limits, count = self.limits, len(change)
        moved = self.measures @ change[:, MOVING].reshape(count, MOTION, 1)
        found = moved[..., 0] @ limits.measured.T
        found[:, limits.linear] = change.reshape(count, 18) @ limits.path.T
        if self.beside is None:
            return np.asarray(found)
        return np.concatenate([found, np.einsum("mcka,mka->mc", self.beside, change)], axis=1)

    def weighted(self, weights: Array) -> Array:
        """Return the sum (m, 6, 3) of the slopes with weights (m, c)."""
        limits, held = self.limits, len(self.limits.measured)
        by_measure = weights[:, None, :held] @ limits.measured
        total = (weights[:, :held][:, limits.linear] @ limits.path).reshape(-1, 6, 3)
        total[:, MOVING] += (by_measure @ self.measures).reshape(-1, 5, 3)
        if self.beside is not None:
            total += np.einsum("mc,mcka->mka", weights[:, held:], self.beside)
        return np.asarray(total)


@lru_cache(maxsize=2)
def measure_functions(has_unequal_drag: bool) -> SmoothFunctions:
    """Compile the measures as functions of velocity to crackle.

    Weight, wind and airframe are shared by all places; each place has its own body axes.
    """

    def kernel(
        ops: Ops, shared: Sequence[Scalar], moved: Sequence[Scalar], axes: Sequence[Scalar]
    ) -> Sequence[Scalar]:
        weight, wind, x, y, z, drag = triples(shared[:-3])
        mass, lateral, axial = shared[-3:]
        airspeed, *others = triples(moved)
        b1, b2, b3 = triples(axes)
        near = weight, add_scaled(airspeed, -1.0, wind), *others
        moving = BodyMotion(*(to_body((b1, b2, b3), each) for each in near))
        airframe = InertiaAndDrag(mass, (x, y, z), lateral, axial, drag if has_unequal_drag else None)
        return measures(ops, airframe, moving, (b1[2], b2[2], b3[2]))

    return smooth_functions(kernel, 21, MOTION, 9, squares=True)
