"""Clearance of the body from obstacles, measured across separating planes.

The plane between a body and a convex piece stays fixed while a path is optimized; its normal n is found anew
in each round. With the position p, the piece's support h along n and the body's extent e against n, the
clearance is n·p − e − h. The body's attitude follows from its thrust. For every plane, the clearance is a
lower bound of the distance from the piece.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

import numpy as np

from aerobat.arrays import Array, Indices
from aerobat.environment.obstacles import Pieces, Separation
from aerobat.kernels.ops import Ops, Scalar, Vector
from aerobat.kernels.vectors import dot
from aerobat.limits.body_in_gate import extent_of_thrust
from aerobat.limits.limit import Limit
from aerobat.limits.quantity import PathQuantity
from aerobat.vehicle import Ellipsoid

SIZE = 0.5  # [m] size of the limit, about the width of a body; violations are fractions of it
NEAREST = 4  # nearest pieces considered at each instant; four are enough in forests
IGNORED_BEYOND = 1.5  # [m] distance beyond which a piece is ignored
# [m] distance within which the best plane is computed exactly: with 0.5 m, plans took a quarter longer
EXACT_WITHIN = 0.2


def limit(margin: float) -> Limit:
    """Return the limit that keeps a clearance of at least `margin` [m]; planes define its quantity later."""
    fields = ("environment.obstacles", "environment.obstacles")
    return Limit("clearance", "m", PathQuantity(), margin, inf, fields, size=SIZE)


class Planes(NamedTuple):
    """Planes between a body and the nearest pieces at m instants; far away where there are fewer pieces."""

    normals: Array  # from the piece to the body, (m, NEAREST, 3)
    offsets: Array  # [m] (m, NEAREST), −infinite for unused planes


@dataclass(frozen=True, eq=False)
class Clearance:
    """The clearance of a body from the obstacle pieces of an environment."""

    pieces: Pieces
    body: Ellipsoid

    def planes(self, positions: Array, thrust_axes: Array, times: Array) -> Planes:
        """Return the planes between the body and the nearest pieces.

        Args:
            positions: Positions of the centre of mass [m], (m, 3).
            thrust_axes: Unit vectors along the thrust axis, (m, 3).
            times: Times of the positions [s], (m,).
        """
        bodies, numbers, found = self._separated(positions, thrust_axes, times, EXACT_WITHIN)
        moved = np.sum(found.normals * self.pieces.moved(numbers, times[bodies]), axis=-1)
        order = np.lexsort((found.gaps, bodies))
        bodies = bodies[order]
        rank = np.arange(len(bodies)) - np.searchsorted(bodies, bodies)
        kept = rank < NEAREST
        rows, ranks, order = bodies[kept], rank[kept], order[kept]
        normals = np.tile([0.0, 0.0, 1.0], (len(positions), NEAREST, 1))
        offsets = np.full((len(positions), NEAREST), -inf)
        normals[rows, ranks], offsets[rows, ranks] = found.normals[order], (found.offsets + moved)[order]
        return Planes(normals, offsets)

    def least(self, positions: Array, thrusts: Array, times: Array) -> tuple[list[float], list[str]]:
        """Return the clearance [m] from the nearest piece at each position (infinite if far), and its name.

        Args:
            positions: Positions of the centre of mass [m], (m, 3).
            thrusts: Vectors of any length along the thrust axis, (m, 3). Zero vectors mean an undetermined
                attitude: the body is then considered in every attitude.
            times: Times of the positions [s], (m,).
        """
        length, revolved = np.linalg.norm(thrusts, axis=-1, keepdims=True), self.body.revolved
        is_falling = length == 0.0
        axes = thrusts / np.where(is_falling, 1.0, length)
        bodies, numbers, found = self._separated(positions, axes, times, inf)
        # without a thrust axis `turned` returns a ball of radius `wide`; the body may reach farther
        beyond = np.where(is_falling[:, 0], revolved.reach - revolved.wide, revolved.aside)
        gaps = found.gaps - beyond[bodies]
        least, names = [inf] * len(positions), [""] * len(positions)
        for body, number, gap in zip(bodies.tolist(), numbers.tolist(), gaps.tolist(), strict=True):
            if gap < least[body]:
                least[body], names[body] = gap, self.pieces.pieces[number].name
        return least, names

    def _separated(
        self, positions: Array, thrust_axes: Array, times: Array, exact_within: float
    ) -> tuple[Indices, Indices, Separation]:
        """Return the indices of nearby bodies and pieces, (m,) each, and the planes between them."""
        revolved = self.body.revolved
        offset, shapes = revolved.turned(thrust_axes)
        centres = positions + offset
        bodies, numbers = self.pieces.near(centres, revolved.reach, IGNORED_BEYOND, times)
        found = self.pieces.separated(numbers, centres[bodies], shapes[bodies], exact_within, times[bodies])
        return bodies, numbers, found


def plane_clearance(
    ops: Ops, revolved: Sequence[Scalar], position: Vector, thrust: Vector, normal: Vector, offset: Scalar
) -> Scalar:
    """Return the clearance between a body and a plane [m].

    Args:
        ops: The arithmetic.
        revolved: The numbers of `Revolved`, the body that contains the vehicle at every angle about its
            thrust axis.
        position: Position of the centre of mass [m].
        thrust: A vector of any length along the thrust axis.
        normal: Normal of the plane, towards the body.
        offset: Offset of the plane along its normal [m].
    """
    against = (-1.0 * normal[0], -1.0 * normal[1], -1.0 * normal[2])
    return dot(normal, position) - extent_of_thrust(ops, revolved, thrust)(against) - offset
