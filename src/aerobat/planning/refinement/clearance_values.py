"""Clearances from obstacles as constraints with two derivatives, compiled to machine code.

In the array of constraints these columns follow those of the limits. At each place they belong to the NEAREST
pieces of obstacles there, so that a column stands for different pieces at different places.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from aerobat.arrays import Array
from aerobat.engines.llvm.functions import NO_DIRECTION, SmoothFunctions, smooth_functions, triples
from aerobat.kernels.ops import Ops, Scalar
from aerobat.limits.clearance import NEAREST, SIZE, Clearance, Planes, plane_clearance
from aerobat.planning.task import Task

MOVED = 6  # number of components of velocity and acceleration, in which clearances are nonlinear
TINY = 1e-20  # lower bound of specific thrusts in a division [m/s²], negligible
FAR = 1e3  # clearance [m] from planes that stand for no obstacle


@dataclass(frozen=True, eq=False)
class ClearanceValues:
    """Constraints (required clearance − clearance) / SIZE ≤ 0 beside separating planes."""

    task: Task

    @cached_property
    def clearance(self) -> Clearance | None:
        """The clearance of the body from all pieces of obstacles; None without obstacles."""
        pieces = self.task.environment.pieces
        return Clearance(pieces, self.task.vehicle.bounding_ellipsoid) if len(pieces) else None

    @property
    def count(self) -> int:
        """The number of constraints at a place."""
        return 0 if self.clearance is None else NEAREST

    def planes(self, times: Array, derivatives: Array) -> Planes:
        """Return the separating planes of a path with derivatives (m, 6, 3) at times (m,)."""
        assert self.clearance is not None, "planes are asked for where there are obstacles"
        thrust = self._thrust(derivatives)
        size = np.linalg.norm(thrust, axis=1, keepdims=True)
        return self.clearance.planes(derivatives[:, 0], thrust / np.maximum(size, TINY), times)

    def values(self, derivatives: Array, planes: Planes) -> Array:
        """Return the values (m, NEAREST) at derivatives (m, 6, 3)."""
        left = _functions().values(*self._inputs(derivatives, planes), NO_DIRECTION)
        found = (self.task.clearance - left.reshape(-1, NEAREST)) / SIZE
        return np.asarray(np.where(np.isnan(found), np.inf, found))

    def slopes(self, derivatives: Array, planes: Planes) -> Array:
        """Return the slopes by the derivatives, (m, NEAREST, 6, 3)."""
        by_thrust = _functions().slopes(*self._inputs(derivatives, planes), np.eye(3))[:, 0].T
        slopes = np.zeros((*planes.offsets.shape, 6, 3))
        slopes[..., 0, :] = -planes.normals / SIZE
        slopes[..., 2, :] = by_thrust.reshape(planes.normals.shape) / -SIZE
        slopes[..., 1, :] = self.task.balance.drag * slopes[..., 2, :]
        return slopes

    def curvature(self, derivatives: Array, planes: Planes, weights: Array) -> Array:
        """Return the Hessian of the weighted values by velocity and acceleration, (m, 6, 6).

        Args:
            derivatives: Derivatives of the path, (m, 6, 3).
            planes: Separating planes at the places.
            weights: Weights of the values, (m, NEAREST).
        """
        inputs = self._inputs(derivatives, planes, weights.reshape(-1, 1) / -SIZE)
        found = _functions().curvature(*inputs, np.eye(3))
        bent = found.transpose(2, 1, 0).reshape(-1, NEAREST, 3, 3).sum(axis=1)
        by_motion = np.array([[self.task.balance.drag], [1.0]])
        return np.kron(by_motion @ by_motion.T, bent)

    def _thrust(self, derivatives: Array) -> Array:
        return self.task.balance.specific_thrust(derivatives[:, 1], derivatives[:, 2])

    def _inputs(self, derivatives: Array, planes: Planes, *more: Array) -> tuple[Array, Array]:
        """Return the functions' inputs: the body; thrust, position, normal, offset, `more` of each plane."""
        state = np.concatenate([self._thrust(derivatives), derivatives[:, 0]], axis=1)
        plane = planes.normals.reshape(-1, 3), np.maximum(planes.offsets, -FAR).reshape(-1, 1)
        own = np.concatenate([state.repeat(NEAREST, axis=0), *plane, *more], axis=1)
        return np.array(self.task.vehicle.bounding_ellipsoid.revolved), own


@lru_cache(maxsize=1)
def _functions() -> SmoothFunctions:
    """Compile the distance [m] between a body and a plane, as a function of the thrust."""

    def kernel(
        ops: Ops, revolved: Sequence[Scalar], thrust: Sequence[Scalar], others: Sequence[Scalar]
    ) -> Sequence[Scalar]:
        (along,), (position, normal) = triples(thrust), triples(others[:6])
        return [plane_clearance(ops, revolved, position, along, normal, others[6])]

    return smooth_functions(kernel, 4, 3, 7)
