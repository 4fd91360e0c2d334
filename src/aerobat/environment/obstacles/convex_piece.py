"""A convex piece of an obstacle: the convex hull of points, rounded by an ellipsoid.

A box is the hull of its corners, a sphere one point rounded by a ball, a capsule two points rounded by a
ball, a cylinder two points rounded by a disc. What a piece is to others is its support h(n), the farthest
that it reaches along a unit vector n: max over its points of n·v, and |Lᵀ n| of its rounding. A plane
n·x = h(n) has the whole piece behind it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from aerobat.arrays import Array

TINY = 1e-12  # [m] beside lengths that divide


@dataclass(frozen=True, eq=False)
class ObstacleMotion:
    """The motion of an obstacle from where its file has it: straight from row to row, without turning."""

    velocity: Array  # [m/s] (3,)
    rows: Array  # time [s] and place [m], (k, 4); it rests before the first and after the last

    @classmethod
    def of(cls, velocity: Array, rows: Array) -> ObstacleMotion | None:
        """Return the motion; None of what stands still."""
        return cls(velocity, rows) if velocity.any() or len(rows) else None

    @property
    def times(self) -> Array:
        """The instants [s] at which its velocity may jump, (k,)."""
        return self.rows[:, 0]

    def moved(self, times: Array) -> Array:
        """Return how far it is from its place at first [m] at times (...), (..., 3)."""
        moved = np.multiply.outer(times, self.velocity)
        if len(self.rows):
            along = [np.interp(times, self.times, each) - each[0] for each in self.rows.T[1:]]
            moved += np.stack(along, axis=-1)
        return np.asarray(moved)

    @property
    def turns(self) -> Array:
        """By how much the velocity jumps at each of `times` [m/s], (k, 3)."""
        slopes = np.diff(self.rows[:, 1:], axis=0) / np.diff(self.times)[:, None]
        return np.diff(slopes, axis=0, prepend=0.0, append=0.0) if len(self.rows) else self.rows[:, 1:]

    def velocity_at(self, time: float) -> Array:
        """Return its velocity [m/s] at a time [s], (3,)."""
        return np.asarray(self.velocity + self.turns[self.times <= time].sum(axis=0))

    def reach(self, begin: Array, end: Array) -> tuple[Array, Array]:
        """Return the least and the most of how far it moves [m] from one time (...) to another, (..., 3)."""
        ends = self.moved(np.stack([begin, end]))
        lower, upper = ends.min(axis=0), ends.max(axis=0)
        first = np.searchsorted(self.times, begin)
        count = np.searchsorted(self.times, end, side="right") - first
        passed = count > 0
        if passed.any():
            # of the longest stretch of 2^level rows among those passed
            level = np.frexp(count[passed])[1] - 1
            last = first[passed] + count[passed] - (1 << level)
            for low, high in (self._extremes[:, level, first[passed]], self._extremes[:, level, last]):
                lower[passed] = np.minimum(lower[passed], low)
                upper[passed] = np.maximum(upper[passed], high)
        return lower, upper

    @cached_property
    def _extremes(self) -> Array:
        """The least and the most of how far it moves at 2^level rows from each on, (2, levels, k, 3)."""
        lower = upper = self.moved(self.times)
        levels = [(lower, upper)]
        for level in range(len(self.rows).bit_length() - 1):
            ahead = np.minimum(np.arange(len(self.rows)) + (1 << level), len(self.rows) - 1)
            lower, upper = np.minimum(lower, lower[ahead]), np.maximum(upper, upper[ahead])
            levels.append((lower, upper))
        return np.stack(levels, axis=1)


@dataclass(frozen=True, eq=False)
class ConvexPiece:
    """The hull of points, each rounded by the ellipsoid of all L y with |y| ≤ 1, in the world at first."""

    points: Array  # [m] (V, 3)
    rounding: Array = field(default_factory=lambda: np.zeros((3, 3)))  # L [m], (3, 3)
    name: str = "obstacle"  # of what it is a piece of
    motion: ObstacleMotion | None = None  # away from where it is here

    def support(self, normals: Array) -> Array:
        """Return how far it reaches [m] along unit vectors (..., 3), (...)."""
        farthest = np.max(normals @ self.points.T, axis=-1)
        return np.asarray(farthest + np.linalg.norm(normals @ self.rounding, axis=-1))

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """The lower and upper corner [m] of the box around it, along the world's axes, (3,) each."""
        reach = np.linalg.norm(self.rounding, axis=1)
        return self.points.min(axis=0) - reach, self.points.max(axis=0) + reach

    def normals_toward(self, points: Array) -> Array:
        """Return unit vectors from it to points (m, 3) [m], the best of planes between or near it, (m, k, 3).

        The normals of its faces; of a straight line the directions from the nearest point of it, square to
        it, and along it.
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
        """The outward normals of the hull's faces, (F, 3); none where its points do not span a solid."""
        from scipy.spatial import ConvexHull, QhullError

        try:
            return np.unique(ConvexHull(self.points).equations[:, :3].round(12), axis=0)
        except (QhullError, ValueError):
            return np.zeros((0, 3))


def units(vectors: Array) -> Array:
    """Return vectors (..., 3) scaled to length one; upward where they are zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(length > TINY, vectors / np.maximum(length, TINY), [0.0, 0.0, 1.0])
