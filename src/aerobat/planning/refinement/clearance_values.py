"""Clearances from obstacles as constraints with two derivatives, compiled once a vehicle.

They are columns behind those of the limits on measures: the nearest pieces of each place, whichever they are.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from aerobat.arrays import Array, xyz
from aerobat.engines.array_functions import COMPLEX_STEP, ArrayFunction, array_function, gradient
from aerobat.engines.tracing import Trace, TraceOps
from aerobat.kernels.vectors import add, add_scaled
from aerobat.limits.clearance import NEAREST, SIZE, Clearance, Planes, left_between
from aerobat.planning.task import Task
from aerobat.problem.problem import DERIVATIVES

MOVED = 6  # components of velocity and acceleration, in which clearances are not linear
FAR = 1e3  # [m] that is left to planes that do not count


@dataclass(frozen=True, eq=False)
class ClearanceValues:
    """Constraints of a margin beside planes, (margin − clearance) / SIZE ≤ 0."""

    task: Task

    @cached_property
    def clearance(self) -> Clearance | None:
        """The clearance that is asked; None where nothing stands in the way."""
        pieces = self.task.environment.pieces
        return Clearance(pieces, self.task.vehicle.bounding_ellipsoid) if len(pieces) else None

    @property
    def count(self) -> int:
        """The number of columns."""
        return 0 if self.clearance is None else NEAREST

    def planes(self, derivatives: Array) -> Planes:
        """The planes at places of a path's derivatives (m, 6, 3)."""
        assert self.clearance is not None, "planes are asked for where there are obstacles"
        thrust = self.task.balance.specific_thrust(derivatives[:, 1], derivatives[:, 2])
        size = np.linalg.norm(thrust, axis=1, keepdims=True)
        return self.clearance.planes(derivatives[:, 0], thrust / np.maximum(size, COMPLEX_STEP))

    def values(self, derivatives: Array, planes: Planes) -> Array:
        """The values at derivatives (m, 6, 3), (m, NEAREST)."""
        given = self._given(derivatives, planes)
        with np.errstate(divide="ignore", invalid="ignore"):
            (found,) = self._functions[0](given)
        return np.asarray(np.where(np.isnan(found), np.inf, found))

    def slopes(self, derivatives: Array, planes: Planes) -> Array:
        """The slopes by the derivatives, (m, NEAREST, 6, 3)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            found = self._functions[1](self._given(derivatives, planes))
        shape = planes.offsets.shape
        slopes = np.zeros((*shape, 18))
        for k, each in enumerate(found):
            slopes[..., k] = np.broadcast_to(each, shape)
        return slopes.reshape(*shape, 6, 3)

    def curvature(self, derivatives: Array, planes: Planes, weights: Array) -> tuple[Array, Array]:
        """The weighted values' slopes (m, 6, 3), and second derivatives by velocity and acceleration.

        Args:
            derivatives: Of the path, (m, 6, 3).
            planes: At the places.
            weights: Of the values, (m, NEAREST).

        Returns:
            The slopes (m, 6, 3), and the second derivatives (m, 6, 6).
        """
        given = self._given(derivatives, planes)
        second = np.empty((len(derivatives), MOVED, MOVED))
        for k in range(MOVED):
            stepped: list[Any] = list(given)
            stepped[3 + k] = given[3 + k] + 1j * COMPLEX_STEP
            with np.errstate(divide="ignore", invalid="ignore"):
                found = self._functions[1](stepped)[3:]
            for j, each in enumerate(found):
                bent = np.broadcast_to(np.imag(each), weights.shape) / COMPLEX_STEP
                second[:, k, j] = np.sum(weights * bent, axis=1)
        slopes = np.einsum("mk,mkij->mij", weights, self.slopes(derivatives, planes))
        return slopes, second

    def _given(self, derivatives: Array, planes: Planes) -> list[Array]:
        """What the functions take: position, velocity, acceleration, normals and offsets, (m, 1) or so."""
        state = derivatives[:, :3].reshape(len(derivatives), 9, 1)
        normals = np.moveaxis(planes.normals, -1, 0)
        return [*np.moveaxis(state, 1, 0), *normals, np.maximum(planes.offsets, -FAR)]

    @cached_property
    def _functions(self) -> tuple[ArrayFunction, ArrayFunction]:
        """What is missing, and its slopes by position, velocity and acceleration."""
        trace = Trace()
        ops = TraceOps(trace)
        position, velocity, acceleration = (trace.vector(name) for name in DERIVATIVES[:3])
        normal, offset = trace.vector("normal"), trace.input("offset")
        balance, body = self.task.balance, self.task.vehicle.bounding_ellipsoid
        thrust = add(add_scaled(acceleration, balance.drag, velocity), xyz(balance.constant))
        left = left_between(ops, body, position, thrust, normal, offset)
        missing = trace.symbol(1.0 / SIZE * (self.task.clearance - left))
        state = [*position, *velocity, *acceleration]
        given = [*state, *normal, offset]
        return array_function(given, [missing]), array_function(given, gradient(missing, state))
