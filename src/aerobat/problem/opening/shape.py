"""The interface of openings for planning, judging and drawing."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from aerobat.arrays import Array

MITRE_LIMIT = 4.0  # ratio of a frame corner's distance to the bars' thickness, at most


class EdgeProbe(NamedTuple):
    """A direction along which a body's extent is compared with an opening."""

    direction: tuple[float, float]  # unit vector (left, up)
    limit: float  # [m] from the gate's position to the edge
    both_ways: bool = False  # the opposite direction counts too
    radial: bool = False  # the extent is the distance of the farthest point, in whichever direction


class Edge(NamedTuple):
    """A straight part of a frame's inner side."""

    middle: Array  # [m] (2,)
    normal: Array  # outward unit vector, (2,)
    half_length: float  # [m]


class LinearBounds(NamedTuple):
    """lower ≤ directions · point ≤ upper."""

    directions: Array  # unit vectors, (n, 2)
    lower: Array  # [m] (n,)
    upper: Array  # [m] (n,)


class OpeningShape(ABC):
    """A convex shape in a gate's plane."""

    @property
    @abstractmethod
    def outline(self) -> Array:
        """Points around the opening [m], anticlockwise with left as the first axis, (K, 2)."""

    @property
    @abstractmethod
    def probes(self) -> tuple[EdgeProbe, ...]:
        """The probes of the opening; a body that is within the limits of all of them is inside."""

    @property
    @abstractmethod
    def sides(self) -> tuple[Array, Array]:
        """Outward normals (S, 2) and distances [m] (S,) of the sides of the polygon that planners use."""

    @property
    @abstractmethod
    def edges(self) -> tuple[Edge, ...]:
        """The edges of a frame around the opening."""

    @abstractmethod
    def fields(self, across: float = 1.0, up: float = 1.0) -> Mapping[str, Any]:
        """Return the fields of a gate with this opening, scaled by `across` and `up`.

        Any but a rectangle is scaled by the smaller factor.
        """

    @property
    @abstractmethod
    def kind(self) -> str:
        """The kind of opening, as text before the width; empty for a rectangle."""

    @abstractmethod
    def depth(self, points: Array) -> Array:
        """Return the depth of points (..., 2) inside the nearest edge [m], (...); negative outside."""

    @abstractmethod
    def at_clearance(self, clearance: float) -> LinearBounds:
        """Return bounds of the part at a clearance [m] from the edges; if it is empty, of the middle."""

    @abstractmethod
    def admits(self, section: Array) -> bool:
        """Return True if the ellipse of all √S u, for unit vectors u and S (2, 2) [m²], fits in unturned."""

    @abstractmethod
    def admits_turned(self, small: float, large: float) -> bool:
        """Return True if an ellipse of these semi-axes [m] fits in, or may fit in, in some orientation."""

    @abstractmethod
    def outward(self, probe: int, points: Array) -> Array:
        """Return the outward normals of the edges nearest to points measured by a probe, (..., 2)."""

    @abstractmethod
    def nearest_on_edge(self, outward: Array, points: Array) -> Array:
        """Return the points on the edges with those outward normals that are nearest to points, (..., 2)."""

    @abstractmethod
    def needed_size(self, reach: Array) -> Array:
        """Return width and height [m] of the smallest similar opening about the same place, (..., 2).

        Args:
            reach: of bodies along the probes [m], (..., probes).
        """

    @property
    @abstractmethod
    def inradius(self) -> float:
        """The radius of the largest circle inside [m]."""

    @property
    def circumradius(self) -> float:
        """The distance [m] of the opening's farthest point from the gate's position."""
        return float(np.linalg.norm(self.outline, axis=1).max())

    @property
    def size(self) -> Array:
        """Width and height [m] of the upright box around the opening, (2,)."""
        return np.asarray(np.ptp(self.outline, axis=0))

    def frame(self, thickness: float) -> Array:
        """Return the outer corners of a frame of this thickness [m], one for each outline point, (K, 2)."""
        points = self.outline
        along = np.roll(points, -1, axis=0) - points
        along /= np.linalg.norm(along, axis=1)[:, None]
        normal = np.column_stack([along[:, 1], -along[:, 0]])
        last = np.roll(normal, 1, axis=0)
        mitre = (normal + last) / (1.0 + np.sum(normal * last, axis=1))[:, None]
        far = np.maximum(np.linalg.norm(mitre, axis=1) / MITRE_LIMIT, 1.0)[:, None]
        return np.asarray(points + thickness * mitre / far)


def edge_name(outward: Array) -> str:
    """Return the name of the edge with an outward normal (2,), in the direction of passage: left, upper, …"""
    left, up = outward / np.linalg.norm(outward)
    diagonal = np.sin(np.pi / 8.0)
    words = (
        "upper" if up > diagonal else "lower" if up < -diagonal else "",
        "left" if left > diagonal else "right" if left < -diagonal else "",
    )
    return " ".join(filter(None, words))
