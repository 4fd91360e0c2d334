"""Convex polygons as openings, with rectangles as a special case."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from itertools import combinations
from typing import Annotated, Any

import numpy as np
from pydantic import Field, PlainValidator

from aerobat.arrays import Array
from aerobat.declaration.field_types import finite
from aerobat.declaration.sentences import FieldError, shown
from aerobat.problem.opening.shape import Edge, EdgeProbe, LinearBounds, OpeningShape

STRAIGHT_SINE = 1e-6  # [-] sine of a turn at a corner below which the corner is on a straight line
MAX_COORDINATE = 1e15  # [m] largest coordinate, as of all lengths in files
MAX_CORNERS = 24  # of a polygon: a flight checks each side at every tick
ROUNDING = 1e-12  # [-] tolerance relative to an opening's size
TURNS = np.radians(np.arange(0.0, 180.0, 5.0))  # [rad] turns in which a section is tried in a polygon


class Polygon(OpeningShape):
    """A convex polygon that contains the gate's position, its corners anticlockwise."""

    def __init__(self, corners: Array) -> None:
        self.corners = corners

    @property
    def outline(self) -> Array:
        """The corners of the polygon."""
        return self.corners

    def fields(self, across: float = 1.0, up: float = 1.0) -> Mapping[str, Any]:
        """See `OpeningShape`."""
        return {"width": None, "height": None, "radius": None, "polygon": min(across, up) * self.corners}

    @property
    def kind(self) -> str:
        """The kind of opening, as text before the width."""
        return f"a polygon of {len(self.corners)} corners, "

    @cached_property
    def sides(self) -> tuple[Array, Array]:
        """The sides of the polygon itself; the first is from the first corner to the second."""
        along = np.roll(self.corners, -1, axis=0) - self.corners
        normals = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
        return normals, np.sum(normals * self.corners, axis=1)

    @property
    def probes(self) -> tuple[EdgeProbe, ...]:
        """The sides of the polygon, each as a probe."""
        normals, distances = self.sides
        return tuple(
            EdgeProbe((x, y), d) for (x, y), d in zip(normals.tolist(), distances.tolist(), strict=True)
        )

    @property
    def edges(self) -> tuple[Edge, ...]:
        """The sides of the polygon, each as an edge."""
        ends = np.roll(self.corners, -1, axis=0)
        halves = np.linalg.norm(ends - self.corners, axis=1) / 2.0
        return tuple(map(Edge, (self.corners + ends) / 2.0, self.sides[0], halves.tolist()))

    def depth(self, points: Array) -> Array:
        """See `OpeningShape`."""
        normals, distances = self.sides
        return np.asarray((distances - points @ normals.T).min(axis=-1))

    @cached_property
    def inradius(self) -> float:
        """The radius of the largest circle inside [m]."""
        return self._largest_inset(np.zeros(len(self.corners)))[0]

    def needed_size(self, reach: Array) -> Array:
        """See `OpeningShape`."""
        return np.asarray((reach / self.sides[1]).max(axis=-1)[..., None] * self.size)

    def at_clearance(self, clearance: float) -> LinearBounds:
        """See `OpeningShape`; the lower bound along each side's normal is at the opposite corner."""
        normals, distances = self.sides
        room, middle = self._largest_inset(np.zeros(len(distances)))
        if clearance >= room:
            return LinearBounds(np.eye(2), middle, middle)
        return LinearBounds(normals, (self.corners @ normals.T).min(axis=0), distances - clearance)

    def admits(self, section: Array) -> bool:
        """See `OpeningShape`; the section's centre may be anywhere."""
        normals, distances = self.sides
        reach = np.sqrt(np.einsum("ki,ij,kj->k", normals, section, normals))
        return self._largest_inset(reach)[0] >= -ROUNDING * float(distances.max())

    def admits_turned(self, small: float, large: float) -> bool:
        """See `OpeningShape`; tolerant by half a step of TURNS, so that an ellipse may not quite fit."""
        slack = (large - small) * np.sin((TURNS[1] - TURNS[0]) / 2.0)
        normals, _ = self.sides
        for turn in TURNS:
            along = normals @ [np.cos(turn), np.sin(turn)]
            reach = np.sqrt(large**2 * along**2 + small**2 * (1.0 - along**2))
            if self._largest_inset(reach)[0] >= -slack:
                return True
        return False

    def outward(self, probe: int, points: Array) -> Array:
        """Return the side's normal."""
        return np.broadcast_to(self.sides[0][probe], points.shape)

    def nearest_on_edge(self, outward: Array, points: Array) -> Array:
        """See `OpeningShape`."""
        side = np.argmax(outward @ self.sides[0].T, axis=-1)
        first, along = self.corners[side], (np.roll(self.corners, -1, axis=0) - self.corners)[side]
        part = np.sum((points - first) * along, axis=-1) / np.sum(along * along, axis=-1)
        return np.asarray(first + np.clip(part, 0.0, 1.0)[..., None] * along)

    def _largest_inset(self, reach: Array) -> tuple[float, Array]:
        """Return the largest clearance [m] of a body of extent `reach` from all sides, and the best point.

        At the optimum three sides are equally near (the optimal vertex of a linear program): all triples of
        sides are tried, which are few for few corners.

        Args:
            reach: of a body beyond the point along each outward normal [m], (S,).
        """
        normals, distances = self.sides
        left = distances - reach
        threes = np.array(list(combinations(range(len(normals)), 3)))
        rows = np.concatenate([normals[threes], np.ones((len(threes), 3, 1))], axis=2)
        solvable = np.abs(np.linalg.det(rows)) > STRAIGHT_SINE
        found = np.linalg.solve(rows[solvable], left[threes[solvable]][..., None])[..., 0]
        fits = (left - found[:, :2] @ normals.T - found[:, 2:]).min(axis=1) >= -ROUNDING * distances.max()
        best = found[fits][np.argmax(found[fits][:, 2])]
        return float(best[2]), best[:2]


class Rectangle(Polygon):
    """A rectangle about the gate's position, its sides parallel to lateral and upright axes."""

    def __init__(self, width: float, height: float) -> None:
        self.width, self.height = width, height
        super().__init__(np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * [width / 2.0, height / 2.0])

    def fields(self, across: float = 1.0, up: float = 1.0) -> Mapping[str, Any]:
        """See `OpeningShape`."""
        return {"width": across * self.width, "height": up * self.height, "radius": None, "polygon": None}

    @property
    def kind(self) -> str:
        """The kind of opening, as text before the width: empty for a rectangle."""
        return ""

    @property
    def probes(self) -> tuple[EdgeProbe, ...]:
        """The lateral and the upright axis, both ways each."""
        return EdgeProbe((1.0, 0.0), self.width / 2.0, True), EdgeProbe((0.0, 1.0), self.height / 2.0, True)

    @property
    def inradius(self) -> float:
        """The radius of the largest circle inside [m]."""
        return min(self.width, self.height) / 2.0

    def needed_size(self, reach: Array) -> Array:
        """See `OpeningShape`; width and height are independent."""
        return 2.0 * reach

    def at_clearance(self, clearance: float) -> LinearBounds:
        """See `OpeningShape`; zero along each axis where the opening is too narrow."""
        reach = np.maximum(np.array([self.width, self.height]) / 2.0 - clearance, 0.0)
        return LinearBounds(np.eye(2), -reach, reach)

    def admits_turned(self, small: float, large: float) -> bool:
        """See `OpeningShape`; exact: the box around an ellipse has the same diagonal in every orientation."""
        narrow = min(self.width, self.height) >= 2.0 * small
        return bool(narrow and np.hypot(self.width, self.height) >= 2.0 * np.hypot(small, large))

    def outward(self, probe: int, points: Array) -> Array:
        """Return the lateral or upright direction toward the points."""
        outward = np.zeros(points.shape)
        outward[..., probe] = np.where(points[..., probe] > 0.0, 1.0, -1.0)
        return outward


def _corners(value: Any) -> Array:
    """Return a convex polygon's corners about (0, 0), anticlockwise. Raises FieldError for any others."""
    if not isinstance(value, list | tuple | np.ndarray) or np.ndim(np.asarray(value, dtype=object)) < 1:
        raise FieldError("", f"must be a list of corners, two numbers each, got {shown(value)}")
    if not 3 <= len(value) <= MAX_CORNERS:
        raise FieldError("", f"must have from 3 to {MAX_CORNERS} corners, got {len(value)}; give as many")
    corners = finite(value, len(value), 2)
    if np.abs(corners).max() > MAX_COORDINATE:
        raise FieldError(
            "", f"must have corners within {MAX_COORDINATE:g} m, got {np.abs(corners).max():g}; check units"
        )
    sides = np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(sides, axis=1)
    if not (lengths > 0.0).all():
        raise FieldError("", f"has the corner {_text(corners[lengths == 0.0])} twice; drop one")
    sides = sides / lengths[:, None]
    last = np.roll(sides, 1, axis=0)
    sines, cosines = last[:, 0] * sides[:, 1] - last[:, 1] * sides[:, 0], np.sum(last * sides, axis=1)
    turns = np.arctan2(sines, cosines)
    sign = np.sign(turns.sum())
    straight = np.abs(sines) < STRAIGHT_SINE
    if straight.any():
        where = _text(corners[straight])
        raise FieldError("", f"has its corner {where} on a line with those beside it; drop or move it")
    if (sign * turns <= 0.0).any():
        where = _text(corners[sign * turns <= 0.0])
        raise FieldError("", f"must be convex, at its corner {where} it turns inward; drop or move that")
    if abs(turns.sum()) > 3.0 * np.pi:
        raise FieldError("", "must go around once, its sides cross; order the corners around it")
    around = corners if sign > 0.0 else np.ascontiguousarray(corners[::-1])
    around.flags.writeable = False
    if Polygon(around).depth(np.zeros(2)) <= 0.0:
        raise FieldError("", "must hold the gate's position, (0, 0), inside; move the corners or the gate")
    return around


def _text(corners: Array) -> str:
    """Return the first of some corners as text, as in files."""
    return "[{:g}, {:g}]".format(*corners[0])


# corners in a gate's plane, left and up from its position, seen in the direction of passage [m], (K, 2)
Corners = Annotated[
    Array, PlainValidator(_corners), Field(description="corners in order, two numbers each: left and up")
]
