"""A convex piece of an obstacle: the convex hull of points, rounded by an ellipsoid.

A box is the hull of its corners, a sphere one point rounded by a ball, a capsule two points rounded by a
ball, a cylinder two points rounded by a disc. Other code uses a piece through its support h(n), its largest
extent along a unit vector n: the maximum of n·v over its points v, plus |Lᵀ n| for its rounding. The whole
piece lies behind the plane n·x = h(n).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from aerobat.arrays import Array

TINY = 1e-12  # [m] smallest divisor of lengths


@dataclass(frozen=True, eq=False)
class ObstacleMotion:
    """The motion of an obstacle from its initial place: translation, straight from row to row."""

    velocity: Array  # [m/s] (3,)
    rows: Array  # time [s] and place [m], (k, 4); at rest before the first row and after the last

    @classmethod
    def of(cls, velocity: Array, rows: Array) -> ObstacleMotion | None:
        """Return the motion, or None for an obstacle at rest."""
        return cls(velocity, rows) if velocity.any() or len(rows) else None

    @property
    def times(self) -> Array:
        """The times [s] at which the velocity may jump, (k,)."""
        return self.rows[:, 0]

    def moved(self, times: Array) -> Array:
        """Return the displacement from the initial place [m] at times (...), (..., 3)."""
        moved = np.multiply.outer(times, self.velocity)
        if len(self.rows):
            along = [np.interp(times, self.times, each) - each[0] for each in self.rows.T[1:]]
            moved += np.stack(along, axis=-1)
        return np.asarray(moved)

    @property
    def velocity_jumps(self) -> Array:
        """The velocity jumps at each of `times` [m/s], (k, 3)."""
        slopes = np.diff(self.rows[:, 1:], axis=0) / np.diff(self.times)[:, None]
        return np.diff(slopes, axis=0, prepend=0.0, append=0.0) if len(self.rows) else self.rows[:, 1:]

    def velocity_at(self, time: float) -> Array:
        """Return the velocity [m/s] at a time [s], (3,)."""
        return np.asarray(self.velocity + self.velocity_jumps[self.times <= time].sum(axis=0))

    def reach(self, begin: Array, end: Array) -> tuple[Array, Array]:
        """Return the smallest and largest displacement [m] per axis between two times (...), (..., 3)."""
        ends = self.moved(np.stack([begin, end]))
        lower, upper = ends.min(axis=0), ends.max(axis=0)
        first = np.searchsorted(self.times, begin)
        count = np.searchsorted(self.times, end, side="right") - first
        passed = count > 0
        if passed.any():
            # two overlapping stretches of 2^level rows cover the passed rows
            level = np.frexp(count[passed])[1] - 1
            last = first[passed] + count[passed] - (1 << level)
            for low, high in (self._extremes[:, level, first[passed]], self._extremes[:, level, last]):
                lower[passed] = np.minimum(lower[passed], low)
                upper[passed] = np.maximum(upper[passed], high)
        return lower, upper

    @cached_property
    def _extremes(self) -> Array:
        """The smallest and largest displacements over 2^level rows from each row on, (2, levels, k, 3)."""
        lower = upper = self.moved(self.times)
        levels = [(lower, upper)]
        for level in range(len(self.rows).bit_length() - 1):
            ahead = np.minimum(np.arange(len(self.rows)) + (1 << level), len(self.rows) - 1)
            lower, upper = np.minimum(lower, lower[ahead]), np.maximum(upper, upper[ahead])
            levels.append((lower, upper))
        return np.stack(levels, axis=1)


@dataclass(frozen=True, eq=False)
class ConvexPiece:
    """The hull of points, rounded by the ellipsoid of all L y with |y| ≤ 1, at its initial place."""

    points: Array  # [m] (V, 3)
    rounding: Array = field(default_factory=lambda: np.zeros((3, 3)))  # L [m], (3, 3)
    name: str = "obstacle"  # name of the obstacle
    motion: ObstacleMotion | None = None  # motion away from the initial place

    def support(self, normals: Array) -> Array:
        """Return the largest extent [m] along unit vectors (..., 3), (...)."""
        farthest = np.max(normals @ self.points.T, axis=-1)
        return np.asarray(farthest + np.linalg.norm(normals @ self.rounding, axis=-1))

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """The lower and upper corner [m] of the bounding box along the world's axes, (3,) each."""
        reach = np.linalg.norm(self.rounding, axis=1)
        return self.points.min(axis=0) - reach, self.points.max(axis=0) + reach

    def normals_toward(self, points: Array) -> Array:
        """Return unit vectors (m, k, 3) towards points (m, 3) [m], for separating planes.

        They are the normals of the piece's faces. For a line they are the directions from its nearest point,
        normal to the line, and along it.
        """
        first = points - self.points[0]
        if len(self.points) > 2 and len(self.face_normals):
            return np.broadcast_to(self.face_normals, (len(points), *self.face_normals.shape))
        if len(self.points) != 2:
            return units(points[:, None] - self.points)
        along = self.points[1] - self.points[0]
        length = max(float(along @ along), TINY)
        nearest = first - np.clip(first @ along / length, 0.0, 1.0)[:, None] * along
        square = first - (first @ along / length)[:, None] * along
        ends = np.broadcast_to(along, first.shape)
        return units(np.stack([nearest, square, ends, -ends], axis=1))

    def distances(self, points: Array) -> Array:
        """Return lower bounds of the distances to points (m, 3) [m], exact beside faces, (m,)."""
        normals = self.normals_toward(points)
        return np.asarray((np.sum(normals * points[:, None], axis=-1) - self.support(normals)).max(axis=1))

    @cached_property
    def face_normals(self) -> Array:
        """The outward normals of the hull's faces, (F, 3); none where the points do not span a solid."""
        from scipy.spatial import ConvexHull, QhullError

        try:
            return np.unique(ConvexHull(self.points).equations[:, :3].round(12), axis=0)
        except (QhullError, ValueError):
            return np.zeros((0, 3))


def units(vectors: Array) -> Array:
    """Return vectors (..., 3) scaled to unit length; upward where they are zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(length > TINY, vectors / np.maximum(length, TINY), [0.0, 0.0, 1.0])
