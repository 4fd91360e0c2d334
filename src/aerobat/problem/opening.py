"""Openings of gates: convex shapes in a gate's plane, by points (left, up) [m] from the gate's position.

All that plans, judges or draws an opening reads it here: which points lie inside and how deep, what is left
at a clearance from the edges, along which directions a body that passes is measured, the outline, the edges.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import cached_property
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from aerobat.arrays import Array

STRAIGHT = 1e-6  # [-] the sine of a turn that is none
ROUNDING = 1e-12  # of an opening's size
TURNS = np.radians(np.arange(0.0, 180.0, 5.0))  # in which a section is tried in a polygon
SHARPEST = 4.0  # by which a frame's outer corner may lie farther out than its bars are thick


class Probe(NamedTuple):
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
    def probes(self) -> tuple[Probe, ...]:
        """The directions in which a body that passes is measured; all within their limits, it is inside."""

    @property
    @abstractmethod
    def sides(self) -> tuple[Array, Array]:
        """Outward normals (S, 2) and distances [m] (S,) of the sides of the polygon that planners take."""

    @property
    @abstractmethod
    def edges(self) -> tuple[Edge, ...]:
        """What a frame around it is made of."""

    @property
    @abstractmethod
    def fields(self) -> Mapping[str, Any]:
        """The fields of a gate with this opening."""

    @property
    @abstractmethod
    def kind(self) -> str:
        """Its kind as it is said before its width, empty of a rectangle."""

    @abstractmethod
    def depth(self, points: Array) -> Array:
        """How deep points (..., 2) lie inside, their distance to the nearest edge [m], (...), or below 0."""

    @abstractmethod
    def at_clearance(self, clearance: float) -> LinearBounds:
        """What is left at a clearance [m] from the edges: in too narrow an opening its middle."""

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
    def resized(self, across: float, up: float) -> OpeningShape:
        """The same with other sizes, as parts of what they are; by the lesser part where it has but one."""

    @abstractmethod
    def needed(self, reach: Array) -> Array:
        """Width and height [m] of the least such opening about the same place, (..., 2).

        Args:
            reach: of bodies along the probes [m], (..., probes).
        """

    @property
    @abstractmethod
    def inradius(self) -> float:
        """How deep [m] its deepest point lies inside."""

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


class Polygon(OpeningShape):
    """A convex polygon that holds the gate's position, its corners anticlockwise."""

    def __init__(self, corners: Array) -> None:
        self.corners = corners

    @property
    def outline(self) -> Array:
        """Its corners."""
        return self.corners

    @property
    def fields(self) -> Mapping[str, Any]:
        """The fields of a gate with this opening."""
        return {"polygon": self.corners}

    @property
    def kind(self) -> str:
        """Its kind as it is said before its width."""
        return f"a polygon of {len(self.corners)} corners, "

    @cached_property
    def sides(self) -> tuple[Array, Array]:
        """Its own sides, the first from the first corner to the second."""
        along = np.roll(self.corners, -1, axis=0) - self.corners
        normals = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
        return normals, np.sum(normals * self.corners, axis=1)

    @property
    def probes(self) -> tuple[Probe, ...]:
        """Its sides."""
        normals, distances = self.sides
        return tuple(Probe((x, y), d) for (x, y), d in zip(normals.tolist(), distances.tolist(), strict=True))

    @property
    def edges(self) -> tuple[Edge, ...]:
        """Its sides."""
        ends = np.roll(self.corners, -1, axis=0)
        halves = np.linalg.norm(ends - self.corners, axis=1) / 2.0
        return tuple(map(Edge, (self.corners + ends) / 2.0, self.sides[0], halves.tolist()))

    def depth(self, points: Array) -> Array:
        """See `OpeningShape`."""
        normals, distances = self.sides
        return np.asarray((distances - points @ normals.T).min(axis=-1))

    @cached_property
    def inradius(self) -> float:
        """How deep [m] its deepest point lies inside."""
        return self._largest_inset(np.zeros(len(self.corners)))[0]

    def needed(self, reach: Array) -> Array:
        """See `OpeningShape`."""
        return np.asarray((reach / self.sides[1]).max(axis=-1)[..., None] * self.size)

    def at_clearance(self, clearance: float) -> LinearBounds:
        """See `OpeningShape`; each side is bounded from beyond by where the opposite corner is."""
        normals, distances = self.sides
        room, middle = self._largest_inset(np.zeros(len(distances)))
        if clearance >= room:
            return LinearBounds(np.eye(2), middle, middle)
        return LinearBounds(normals, (self.corners @ normals.T).min(axis=0), distances - clearance)

    def admits(self, section: Array) -> bool:
        """See `OpeningShape`; wherever its centre is."""
        normals, distances = self.sides
        reach = np.sqrt(np.einsum("ki,ij,kj->k", normals, section, normals))
        return self._largest_inset(reach)[0] >= -ROUNDING * float(distances.max())

    def admits_turned(self, small: float, large: float) -> bool:
        """See `OpeningShape`; where it reaches too far by what half a turn of TURNS changes it may fit."""
        slack = (large - small) * np.sin((TURNS[1] - TURNS[0]) / 2.0)
        normals, _ = self.sides
        for turn in TURNS:
            along = normals @ [np.cos(turn), np.sin(turn)]
            reach = np.sqrt(large**2 * along**2 + small**2 * (1.0 - along**2))
            if self._largest_inset(reach)[0] >= -slack:
                return True
        return False

    def outward(self, probe: int, points: Array) -> Array:
        """The side's normal."""
        return np.broadcast_to(self.sides[0][probe], points.shape)

    def nearest_on_edge(self, outward: Array, points: Array) -> Array:
        """See `OpeningShape`."""
        side = np.argmax(outward @ self.sides[0].T, axis=-1)
        first, along = self.corners[side], (np.roll(self.corners, -1, axis=0) - self.corners)[side]
        part = np.sum((points - first) * along, axis=-1) / np.sum(along * along, axis=-1)
        return np.asarray(first + np.clip(part, 0.0, 1.0)[..., None] * along)

    def resized(self, across: float, up: float) -> OpeningShape:
        """See `OpeningShape`."""
        return Polygon(min(across, up) * self.corners)

    def _largest_inset(self, reach: Array) -> tuple[float, Array]:
        """The largest distance [m] that is left on all sides beside what is reached there, and the point.

        Three sides are as near as that: of all three the point is tried, which is few for few corners.

        Args:
            reach: of a body beyond the point along each outward normal [m], (S,).
        """
        normals, distances = self.sides
        left = distances - reach
        threes = np.array(list(combinations(range(len(normals)), 3)))
        rows = np.concatenate([normals[threes], np.ones((len(threes), 3, 1))], axis=2)
        solvable = np.abs(np.linalg.det(rows)) > STRAIGHT
        found = np.linalg.solve(rows[solvable], left[threes[solvable]][..., None])[..., 0]
        fits = (left - found[:, :2] @ normals.T - found[:, 2:]).min(axis=1) >= -ROUNDING * distances.max()
        best = found[fits][np.argmax(found[fits][:, 2])]
        return float(best[2]), best[:2]


class Rectangle(Polygon):
    """A rectangle about the gate's position, its sides along lateral and upright."""

    def __init__(self, width: float, height: float) -> None:
        self.width, self.height = width, height
        super().__init__(np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * [width / 2.0, height / 2.0])

    @property
    def fields(self) -> Mapping[str, Any]:
        """The fields of a gate with this opening."""
        return {"width": self.width, "height": self.height}

    @property
    def kind(self) -> str:
        """Its kind as it is said before its width: none, it is what gates are."""
        return ""

    @property
    def probes(self) -> tuple[Probe, ...]:
        """Across and up, both ways each."""
        return Probe((1.0, 0.0), self.width / 2.0, True), Probe((0.0, 1.0), self.height / 2.0, True)

    @property
    def inradius(self) -> float:
        """How deep [m] its deepest point lies inside."""
        return min(self.width, self.height) / 2.0

    def needed(self, reach: Array) -> Array:
        """See `OpeningShape`; width and height, each for itself."""
        return 2.0 * reach

    def at_clearance(self, clearance: float) -> LinearBounds:
        """See `OpeningShape`; the middle along each axis where it is too narrow along that."""
        reach = np.maximum(np.array([self.width, self.height]) / 2.0 - clearance, 0.0)
        return LinearBounds(np.eye(2), -reach, reach)

    def admits_turned(self, small: float, large: float) -> bool:
        """See `OpeningShape`; exactly: the box around an ellipse has one diagonal, however it is turned."""
        narrow = min(self.width, self.height) >= 2.0 * small
        return bool(narrow and np.hypot(self.width, self.height) >= 2.0 * np.hypot(small, large))

    def outward(self, probe: int, points: Array) -> Array:
        """Across or up, to the side where the points are."""
        outward = np.zeros(points.shape)
        outward[..., probe] = np.where(points[..., probe] > 0.0, 1.0, -1.0)
        return outward

    def resized(self, across: float, up: float) -> OpeningShape:
        """See `OpeningShape`."""
        return Rectangle(across * self.width, up * self.height)


def edge_name(outward: Array) -> str:
    """The edge with an outward normal (2,), as who passes upright sees it: left, upper, upper left, …"""
    left, up = outward / np.linalg.norm(outward)
    diagonal = np.sin(np.pi / 8.0)
    words = (
        "upper" if up > diagonal else "lower" if up < -diagonal else "",
        "left" if left > diagonal else "right" if left < -diagonal else "",
    )
    return " ".join(filter(None, words))
