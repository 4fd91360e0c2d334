"""Clearances from obstacles as constraints with two derivatives, compiled once a vehicle.

They are columns behind those of the limits on measures: the nearest pieces of each place, whichever they are.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from aerobat.arrays import Array
from aerobat.engines.array_functions import COMPLEX_STEP, ArrayFunction, array_function, gradient
from aerobat.engines.tracing import Trace, TraceOps
from aerobat.limits.clearance import NEAREST, SIZE, Clearance, Planes, left_between
from aerobat.planning.task import Task

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

    def planes(self, times: Array, derivatives: Array) -> Planes:
        """The planes at places of a path's derivatives (m, 6, 3) at times (m,)."""
        assert self.clearance is not None, "planes are asked for where there are obstacles"
        thrust = self._thrust(derivatives)
        size = np.linalg.norm(thrust, axis=1, keepdims=True)
        return self.clearance.planes(derivatives[:, 0], thrust / np.maximum(size, COMPLEX_STEP), times)

    def values(self, derivatives: Array, planes: Planes) -> Array:
        """The values at derivatives (m, 6, 3), (m, NEAREST)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            (found,) = self._functions[0](self._given(derivatives, planes))
        return np.asarray(np.where(np.isnan(found), np.inf, found))

    def slopes(self, derivatives: Array, planes: Planes) -> Array:
        """The slopes by the derivatives, (m, NEAREST, 6, 3)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            by_thrust = self._functions[1](self._given(derivatives, planes))
        slopes = np.zeros((*planes.offsets.shape, 6, 3))
        slopes[..., 0, :] = -planes.normals / SIZE
        slopes[..., 2, :] = np.stack(by_thrust, axis=-1)
        slopes[..., 1, :] = self.task.balance.drag * slopes[..., 2, :]
        return slopes

    def curvature(self, derivatives: Array, planes: Planes, weights: Array) -> Array:
        """Second derivatives of the weighted values by velocity and acceleration, (m, 6, 6).

        Args:
            derivatives: Of the path, (m, 6, 3).
            planes: At the places.
            weights: Of the values, (m, NEAREST).
        """
        given = self._given(derivatives, planes)
        for k in range(3):
            given[3 + k] = given[3 + k] + 1j * COMPLEX_STEP * np.eye(3)[k].reshape(3, 1, 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.stack(self._functions[1](given), axis=-1)
        bent = np.einsum("mk,imkj->mij", weights, found.imag) / COMPLEX_STEP
        by_motion = np.array([[self.task.balance.drag], [1.0]])
        return np.kron(by_motion @ by_motion.T, bent)

    def _thrust(self, derivatives: Array) -> Array:
        return self.task.balance.specific_thrust(derivatives[:, 1], derivatives[:, 2])

    def _given(self, derivatives: Array, planes: Planes) -> list[Array]:
        """What the functions take: position, thrust, normals and offsets, (m, 1) or so."""
        state = np.concatenate([derivatives[:, 0], self._thrust(derivatives)], axis=1)
        normals = np.moveaxis(planes.normals, -1, 0)
        return [*state.T[..., None], *normals, np.maximum(planes.offsets, -FAR)]

    @cached_property
    def _functions(self) -> tuple[ArrayFunction, ArrayFunction]:
        """What is missing, and its slopes by the thrust."""
        trace = Trace()
        position, thrust, normal = (trace.vector(name) for name in ("position", "thrust", "normal"))
        offset, body = trace.input("offset"), self.task.vehicle.bounding_ellipsoid
        left = left_between(TraceOps(trace), body, position, thrust, normal, offset)
        missing = trace.symbol(1.0 / SIZE * (self.task.clearance - left))
        given = [*position, *thrust, *normal, offset]
        return array_function(given, [missing]), array_function(given, gradient(missing, thrust))
