"""The interface of openings for all that plans, judges and draws them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from aerobat.arrays import Array

SHARPEST = 4.0  # by which a frame's outer corner may lie farther out than its bars are thick


class EdgeProbe(NamedTuple):
    """A direction in which a body that passes is measured against an opening."""

    direction: tuple[float, float]  # unit vector (left, up)
    limit: float  # [m] from the gate's position to the edge
    both_ways: bool = False  # against the direction too
    radial: bool = False  # the distance of the farthest point, in whichever direction that is


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
        """Points around it [m], anticlockwise with left as the first axis, (K, 2)."""

    @property
    @abstractmethod
    def probes(self) -> tuple[EdgeProbe, ...]:
        """The directions in which a body that passes is measured; all within their limits, it is inside."""

    @property
    @abstractmethod
    def sides(self) -> tuple[Array, Array]:
        """Outward normals (S, 2) and distances [m] (S,) of the sides of the polygon that planners take."""

    @property
    @abstractmethod
    def edges(self) -> tuple[Edge, ...]:
        """The edges of which a frame around the opening is made."""

    @abstractmethod
    def fields(self, across: float = 1.0, up: float = 1.0) -> Mapping[str, Any]:
        """Return the fields of a gate with this opening, scaled by `across` and `up`.

        Any but a rectangle is scaled by the smaller factor.
        """

    @property
    @abstractmethod
    def kind(self) -> str:
        """The kind of opening, as it is said before the width; empty for a rectangle."""

    @abstractmethod
    def depth(self, points: Array) -> Array:
        """Return the depth of points (..., 2) inside: distances [m] to the nearest edge (...), or below 0."""

    @abstractmethod
    def at_clearance(self, clearance: float) -> LinearBounds:
        """Return the part left at a clearance [m] from the edges: in too narrow an opening its middle."""

    @abstractmethod
    def admits(self, section: Array) -> bool:
        """True if the ellipse of all √S u fits in as it is turned, with unit vectors u and S (2, 2) [m²]."""

    @abstractmethod
    def admits_turned(self, small: float, large: float) -> bool:
        """True if an ellipse of such semi-axes [m] fits in however it is turned, or may do."""

    @abstractmethod
    def outward(self, probe: int, points: Array) -> Array:
        """The outward normals of the edges that points measured by a probe are next to, (..., 2)."""

    @abstractmethod
    def nearest_on_edge(self, outward: Array, points: Array) -> Array:
        """The points of the edges with those outward normals that are next to points, (..., 2)."""

    @abstractmethod
    def needed(self, reach: Array) -> Array:
        """Width and height [m] of the least such opening about the same place, (..., 2).

        Args:
            reach: of bodies along the probes [m], (..., probes).
        """

    @property
    @abstractmethod
    def inradius(self) -> float:
        """The radius of the largest circle inside [m]."""

    @property
    def circumradius(self) -> float:
        """The distance [m] of its farthest point from the gate's position."""
        return float(np.linalg.norm(self.outline, axis=1).max())

    @property
    def size(self) -> Array:
        """Width and height [m] of the upright box around it, (2,)."""
        return np.asarray(np.ptp(self.outline, axis=0))

    def frame(self, thickness: float) -> Array:
        """The outer corners of a frame of such thickness [m], one for each point of the outline, (K, 2)."""
        points = self.outline
        along = np.roll(points, -1, axis=0) - points
        along /= np.linalg.norm(along, axis=1)[:, None]
        normal = np.column_stack([along[:, 1], -along[:, 0]])
        last = np.roll(normal, 1, axis=0)
        mitre = (normal + last) / (1.0 + np.sum(normal * last, axis=1))[:, None]
        far = np.maximum(np.linalg.norm(mitre, axis=1) / SHARPEST, 1.0)[:, None]
        return np.asarray(points + thickness * mitre / far)


def edge_name(outward: Array) -> str:
    """The edge with an outward normal (2,), as who passes upright sees it: left, upper, upper left, …"""
    left, up = outward / np.linalg.norm(outward)
    diagonal = np.sin(np.pi / 8.0)
    words = (
        "upper" if up > diagonal else "lower" if up < -diagonal else "",
        "left" if left > diagonal else "right" if left < -diagonal else "",
    )
    return " ".join(filter(None, words))
