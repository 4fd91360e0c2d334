"""Obstacles of simple shapes: boxes, spheres, capsules, cylinders, half-spaces and convex polytopes."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, PlainValidator

from aerobat import so3
from aerobat.arrays import Array
from aerobat.declaration import Angle, FieldError, Label, Positive, UnitVector, Vector3, finite
from aerobat.environment.obstacles.attitude import ATTITUDE, axes_of
from aerobat.environment.obstacles.convex_piece import ConvexPiece
from aerobat.environment.obstacles.obstacle import Obstacle, obstacle

FAR = 1000.0  # [m] extent in each direction of the box that represents a half-space
CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))  # corners of a box of two by two by two


def _size(value: Any) -> Array:
    size = finite(value, 3)
    if not (size > 0.0).all():
        given = ", ".join(f"{each:g}" for each in size)
        raise FieldError("", f"must be three positive numbers, got {given}")
    return size


def corners_of_solid(value: Any) -> Array:
    """Return points (n, 3) that span a solid. Raise FieldError for others."""
    count = len(value) if hasattr(value, "__len__") else 0
    points = finite(value, count, 3) if count else np.zeros((0, 3))
    if len(points) < 4 or np.linalg.matrix_rank(points - points[0], 1e-9) < 3:
        raise FieldError("", "must be four points or more that do not lie in one plane")
    return points


Size = Annotated[Array, PlainValidator(_size), Field(description="three positive numbers")]
Points = Annotated[Array, PlainValidator(corners_of_solid), Field(description="points of three numbers each")]


@obstacle("box")
class Box(Obstacle):
    """A box, in any attitude."""

    position: Vector3  # [m] its middle
    size: Size  # [m] its length, width and height along its own axes
    heading: Angle = 0.0  # [rad] of its length, from x toward y
    elevation: Angle = 0.0  # [rad] climb of its length
    tilt: Angle = 0.0  # [rad] roll about its length, right-handed
    name: Label = "box"  # by which findings name it

    SHORTHANDS: ClassVar[Mapping[str, str]] = ATTITUDE

    @property
    def axes(self) -> Array:
        """The directions of length, width and height in the world, unit vectors as columns, (3, 3)."""
        return axes_of(self.heading, self.elevation, self.tilt)

    @property
    def pieces(self) -> tuple[ConvexPiece, ...]:
        """The convex hull of its corners."""
        corners = self.position + (CORNERS * self.size / 2.0) @ self.axes.T
        return (ConvexPiece(corners, name=self.name),)


@obstacle("sphere")
class Sphere(Obstacle):
    """A ball."""

    position: Vector3  # [m] its middle
    radius: Positive  # [m]
    name: Label = "sphere"  # by which findings name it

    @property
    def pieces(self) -> tuple[ConvexPiece, ...]:
        """The centre, rounded by a ball."""
        return (ConvexPiece(self.position[None], self.radius * np.eye(3), self.name),)


@obstacle("capsule")
class Capsule(Obstacle):
    """All points near a straight line between two points."""

    start: Vector3  # [m] one end of the line
    end: Vector3  # [m] the other
    radius: Positive  # [m]
    name: Label = "capsule"  # by which findings name it

    @property
    def pieces(self) -> tuple[ConvexPiece, ...]:
        """The line, rounded by a ball."""
        return (ConvexPiece(np.array([self.start, self.end]), self.radius * np.eye(3), self.name),)


@obstacle("cylinder")
class Cylinder(Obstacle):
    """A cylinder between two points, flat at its ends: a trunk, a pillar, a pipe."""

    start: Vector3  # [m] the middle of one end
    end: Vector3  # [m] the middle of the other
    radius: Positive  # [m]
    name: Label = "cylinder"  # by which findings name it

    def __post_init__(self) -> None:
        """Raise FieldError for coinciding ends."""
        if np.linalg.norm(self.end - self.start) < 1e-9:
            raise FieldError("end", "must be another point than start")

    @property
    def pieces(self) -> tuple[ConvexPiece, ...]:
        """The axis, rounded by a disc."""
        along = (self.end - self.start) / np.linalg.norm(self.end - self.start)
        disc = self.radius * (np.eye(3) - np.outer(along, along))
        return (ConvexPiece(np.array([self.start, self.end]), disc, self.name),)


@obstacle("half-space")
class HalfSpace(Obstacle):
    """All that lies behind a plane: a ceiling, a slope, the wall of a hall."""

    position: Vector3  # [m] a point of the plane
    normal: UnitVector  # out of what is solid
    name: Label = "half-space"  # by which findings name it

    @property
    def pieces(self) -> tuple[ConvexPiece, ...]:
        """A box behind the plane, larger than any space that is flown in."""
        turned = so3.axes(so3.smallest_rotation(so3.UP, self.normal))
        corners = (CORNERS - so3.UP) * [FAR, FAR, FAR / 2.0] @ turned.T
        return (ConvexPiece(self.position + corners, name=self.name),)


@obstacle("polytope")
class Polytope(Obstacle):
    """The convex hull of points."""

    points: Points  # [m] its corners, and any others in it
    name: Label = "polytope"  # by which findings name it

    @property
    def pieces(self) -> tuple[ConvexPiece, ...]:
        """The hull of its points."""
        return (ConvexPiece(self.points, name=self.name),)
