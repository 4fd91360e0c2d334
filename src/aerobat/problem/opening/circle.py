"""Circles as openings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from aerobat.arrays import Array
from aerobat.problem.opening.shape import Edge, EdgeProbe, LinearBounds, OpeningShape

CIRCLE_POINTS = 48  # points of a circle's outline, and edges of the frame around it
CIRCLE_SIDES = 24  # of the inscribed polygon that planners use: 0.9 % of the radius is lost


class Circle(OpeningShape):
    """A circle about the gate's position.

    Bodies are judged by the farthest of the points that they reach in CIRCLE_SIDES directions, which
    underestimates their extent by at most 0.2 % of the radius. Planners use the inscribed regular polygon.
    """

    def __init__(self, radius: float) -> None:
        self.radius = radius

    @property
    def outline(self) -> Array:
        """Points on the circle, the first on the left."""
        return self.radius * _directions(CIRCLE_POINTS)

    def fields(self, across: float = 1.0, up: float = 1.0) -> Mapping[str, Any]:
        """See `OpeningShape`."""
        return {"width": None, "height": None, "radius": min(across, up) * self.radius, "polygon": None}

    @property
    def kind(self) -> str:
        """The kind of opening, as text before the width."""
        return "round, "

    @property
    def probes(self) -> tuple[EdgeProbe, ...]:
        """Half of the directions around the circle, both ways each."""
        half = _directions(CIRCLE_SIDES)[: CIRCLE_SIDES // 2]
        return tuple(EdgeProbe((x, y), self.radius, True, True) for x, y in half.tolist())

    @property
    def sides(self) -> tuple[Array, Array]:
        """The sides of the inscribed regular polygon."""
        return _directions(CIRCLE_SIDES), np.full(CIRCLE_SIDES, _INSCRIBED * self.radius)

    @property
    def edges(self) -> tuple[Edge, ...]:
        """Tangents all around."""
        half = self.radius * np.tan(np.pi / CIRCLE_POINTS)
        return tuple(Edge(self.radius * normal, normal, half) for normal in _directions(CIRCLE_POINTS))

    @property
    def inradius(self) -> float:
        """The radius of the circle [m]."""
        return self.radius

    def depth(self, points: Array) -> Array:
        """See `OpeningShape`."""
        return np.asarray(self.radius - np.linalg.norm(points, axis=-1))

    def at_clearance(self, clearance: float) -> LinearBounds:
        """See `OpeningShape`; the regular polygon inscribed in the smaller circle."""
        if clearance >= self.radius:
            return LinearBounds(np.eye(2), np.zeros(2), np.zeros(2))
        reach = np.full(CIRCLE_SIDES // 2, _INSCRIBED * (self.radius - clearance))
        return LinearBounds(_directions(CIRCLE_SIDES)[: CIRCLE_SIDES // 2], -reach, reach)

    def admits(self, section: Array) -> bool:
        """See `OpeningShape`."""
        return bool(np.linalg.eigvalsh(section)[-1] <= self.radius**2)

    def admits_turned(self, small: float, large: float) -> bool:
        """See `OpeningShape`."""
        return large <= self.radius

    def outward(self, probe: int, points: Array) -> Array:
        """Return the directions away from the middle."""
        distance = np.linalg.norm(points, axis=-1, keepdims=True)
        return np.where(distance > 0.0, points / np.where(distance > 0.0, distance, 1.0), [0.0, 1.0])

    def nearest_on_edge(self, outward: Array, points: Array) -> Array:
        """See `OpeningShape`."""
        return self.radius * outward

    def needed_size(self, reach: Array) -> Array:
        """See `OpeningShape`."""
        return np.repeat(2.0 * reach.max(axis=-1)[..., None], 2, axis=-1)


_INSCRIBED = float(np.cos(np.pi / CIRCLE_SIDES))  # [-] inradius of the polygon over the circle's radius


def _directions(count: int) -> Array:
    """Return `count` unit vectors, evenly spaced, the first to the left, (count, 2)."""
    angles = 2.0 * np.pi * np.arange(count) / count
    return np.column_stack([np.cos(angles), np.sin(angles)])
