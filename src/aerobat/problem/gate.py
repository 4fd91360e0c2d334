"""A gate: an opening in the world with a direction of passage and an upright direction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from math import degrees, radians
from typing import Any, ClassVar, cast

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import (
    Angle,
    FieldError,
    Label,
    Positive,
    UnitVector,
    Vector3,
    VectorLike,
    by_value,
    declared,
    from_table,
    number,
    positive,
    unit,
    unknown_name,
    validated,
)
from aerobat.environment.obstacles.attitude import axes_of
from aerobat.environment.obstacles.convex_piece import ConvexPiece, ObstacleMotion
from aerobat.environment.obstacles.obstacle import Obstacle
from aerobat.environment.obstacles.path_rows import PathRows
from aerobat.errors import SpecError
from aerobat.problem.condition import Condition, ConeAngle, Quantity
from aerobat.problem.opening import Circle, Corners, OpeningShape, Polygon, Rectangle
from aerobat.problem.wall import Wall

DEFAULT_SIZE = (1.0, 0.6)  # [m] width and height of a rectangular opening
MAX_ROWS = 64  # of a path: a flight checks all of them at every tick
CONTACT_TOLERANCE = 1e-6  # [m] within which frames touch, so that neither intersects the other's opening


@declared
class Gate:
    """An opening that a vehicle passes with its thrust axis along `up`: rectangle, circle or convex polygon.

    An upright gate has up = +z; a gate that is passed upside down has up = −z; the paper's half-flip
    gate, tilted by 90°, has up in the horizontal plane (Section II-D). Files give the attitude by angles.
    A polygon's corners are given as seen in the direction of passage with `up` upward, in either order around
    it. Raises SpecError when `up` is not normal to `normal`, and for an opening of two kinds.
    """

    position: Vector3  # [m] centre of the opening, a place inside of a polygon
    normal: UnitVector  # direction of passage; instead of angles
    up: UnitVector  # upright of the opening, normal to `normal`; instead of angles
    width: Positive | None = None  # [m] of a rectangular opening; left out, 1
    height: Positive | None = None  # [m] likewise; left out, 0.6
    name: Label = "gate"  # by which stages and waypoints refer to it
    # between the thrust axis and `up` in the gate, at most, where a maneuver asks for its attitude
    attitude_tolerance: ConeAngle = radians(5.0)  # [rad]
    radius: Positive | None = None  # [m] of a round opening, instead of width and height
    polygon: Corners | None = None  # [m] of any other convex opening, from `position`, instead of those
    wall: Wall | None = None  # around the opening, an obstacle; `true` in a file for one of the usual size
    velocity: Vector3 = field(default_factory=lambda: np.zeros(3))  # [m/s] with which it moves
    # t [s], x, y, z [m] of a point of it: straight from row to row, in its place at the first
    path: PathRows = field(default_factory=lambda: np.zeros((0, 4)))

    SHORTHANDS: ClassVar[Mapping[str, str]] = {
        "heading_deg": "[deg] direction of passage, from x toward y (0)",
        "elevation_deg": "[deg] climb of the direction of passage (0)",
        "tilt_deg": "[deg] roll about the passage, to the right: 90 sideways, 180 upside down (0)",
        "attitude_tolerance_deg": "[deg] `attitude_tolerance` in degrees (5)",
        "diameter": "[m] twice `radius`",
    }
    ANGLES: ClassVar[tuple[str, ...]] = ("heading_deg", "elevation_deg", "tilt_deg")

    def __post_init__(self) -> None:
        """Check the directions and the opening, and set the default size."""
        if abs(self.normal @ self.up) > 1e-6:
            raise FieldError("up", "must be normal to normal, the direction of passage")
        if len(self.path) > MAX_ROWS:
            raise FieldError("path", f"of a gate must have {MAX_ROWS} rows at most, got {len(self.path)}")
        kinds = ("polygon", "radius", "width", "height")
        given = [key for key in kinds if getattr(self, key) is not None]
        if self.polygon is not None or self.radius is not None:
            if len(given) > 1:
                raise FieldError(
                    given[0], f"stands beside {given[1]}, an opening of another kind; drop either"
                )
            return
        for key, size in zip(("width", "height"), DEFAULT_SIZE, strict=True):
            if getattr(self, key) is None:
                object.__setattr__(self, key, size)

    @classmethod
    def expand(cls, table: dict[str, Any]) -> dict[str, Any]:
        """Replace angles by `normal` and `up`; angles may not be given beside these."""
        if isinstance(table.get("wall"), bool):
            table["wall"] = Wall() if table["wall"] else None
        if "diameter" in table:
            if "radius" in table:
                raise FieldError("diameter", "stands beside radius; give one or the other")
            table["radius"] = positive(table.pop("diameter"), "diameter") / 2.0
        angles = {key: table.pop(key) for key in cls.ANGLES if key in table}
        if "normal" not in table and "up" not in table:
            attitude = [radians(number(angles.get(key, 0.0), key)) for key in cls.ANGLES]
            table["normal"], table["up"] = _directions(*attitude)
        elif angles:
            raise FieldError(next(iter(angles)), "stands beside normal and up; give one or the other")
        return table

    def abbreviate(self, table: dict[str, Any]) -> dict[str, Any]:
        """Write `normal` and `up` as angles where the angles reproduce them exactly."""
        for key, size in zip(("width", "height"), DEFAULT_SIZE, strict=True):
            if table.get(key) == size:
                del table[key]
        for digits in (9, 17):
            angles = {
                key: round(degrees(angle), digits)
                for key, angle in zip(self.ANGLES, self.angles, strict=True)
            }
            again = from_table(Gate, {"position": self.position, **angles})
            if (again.normal == self.normal).all() and (again.up == self.up).all():
                del table["normal"], table["up"]
                return table | {key: angle for key, angle in angles.items() if angle != 0.0}
        return table

    @cached_property
    def motion(self) -> ObstacleMotion | None:
        """The gate's motion, relative to its initial place; None for a gate that does not move."""
        return ObstacleMotion.of(self.velocity, self.path)

    def places(self, times: Array) -> Array:
        """Return the position of the opening's centre [m] at times (...), (..., 3)."""
        moved = 0.0 if self.motion is None else self.motion.moved(times)
        return np.asarray(np.broadcast_to(self.position + moved, (*times.shape, 3)))

    def at(self, time: float) -> Gate:
        """Return the gate at its place at a time [s], without motion."""
        if self.motion is None:
            return self
        place = self.places(np.array(time))
        return replace(self, position=place, velocity=np.zeros(3), path=np.zeros((0, 4)))

    @cached_property
    def lateral(self) -> Array:
        """The unit vector across the opening, to the left in the direction of passage, (3,)."""
        return unit(np.cross(self.up, self.normal))

    @cached_property
    def opening(self) -> OpeningShape:
        """The shape of the opening in its plane, in coordinates (left, up)."""
        if self.polygon is not None:
            return Polygon(self.polygon)
        if self.radius is not None:
            return Circle(self.radius)
        return Rectangle(self.width or 0.0, self.height or 0.0)

    @property
    def plane_axes(self) -> Array:
        """The unit vectors left and up of the opening in the world, (2, 3)."""
        return np.array([self.lateral, self.up])

    @property
    def outline(self) -> Array:
        """Points around the opening in the world [m], in order; the corners of a rectangle; (K, 3)."""
        return self.position + self.opening.outline @ self.plane_axes

    def frame(self, thickness: float) -> Array:
        """Return a frame's outer corners [m] for a thickness [m], one for each point of `outline`, (K, 3)."""
        return self.position + self.opening.frame(thickness) @ self.plane_axes

    def plane_around(self, border: float) -> tuple[ConvexPiece, ...]:
        """Return the gate's plane around the opening up to a border [m], where a body hits the frame."""
        return _around(self, Wall(border), f"the frame of {self.name}", np.zeros(1))

    @cached_property
    def solid(self) -> Obstacle | None:
        """The wall around the opening as an obstacle; None where there is no wall."""
        return None if self.wall is None else GateWall.of(self)

    def resized(self, across: float, up: float) -> Gate:
        """Return the gate with its opening scaled by `across` and `up`; by the smaller unless a rectangle."""
        return replace(self, **self.opening.fields(across, up))

    def stands_in(self, other: Gate) -> bool:
        """Return True if an edge of this opening, where the frame is, intersects the other gate's opening."""
        points = (self.outline - other.position) @ np.array([other.lateral, other.up, other.normal]).T
        last = np.roll(points, 1, axis=0)
        height, last_height = points[:, 2:], last[:, 2:]
        crosses = np.minimum(height, last_height) * np.maximum(height, last_height) < 0.0
        rise = np.where(crosses, height - last_height, 1.0)
        crossings = np.where(crosses, last - last_height / rise * (points - last), points)
        in_opening = other.opening.depth(crossings[:, :2]) > CONTACT_TOLERANCE
        return bool((in_opening & (np.abs(crossings[:, 2]) < CONTACT_TOLERANCE)).any())

    @property
    def angles(self) -> tuple[float, float, float]:
        """Heading, elevation and tilt [rad], as `tilted_gate` takes them."""
        heading = float(np.arctan2(self.normal[1], self.normal[0]))
        elevation = float(np.arcsin(np.clip(self.normal[2], -1.0, 1.0)))
        upright = tilted_gate(self.position, heading, elevation)
        return heading, elevation, float(np.arctan2(-self.up @ upright.lateral, self.up @ upright.up))

    @validated
    def tilted(self, tilt: Angle) -> Gate:
        """Return the gate with another tilt [rad]."""
        heading, elevation, _ = self.angles
        normal, up = _directions(heading, elevation, tilt)
        return replace(self, normal=normal, up=up)


@by_value
class GateWall(Obstacle):
    """The wall of a gate: a convex piece beside each side of the polygon that approximates the opening.

    The pieces overlap one another, and leave the opening free.
    """

    gate: Gate

    @classmethod
    def of(cls, gate: Gate) -> GateWall:
        """Return the wall of a gate, which moves with the gate."""
        return cls(gate, velocity=gate.velocity, path=gate.path)

    @property
    def pieces(self) -> tuple[ConvexPiece, ...]:
        """The parts of the wall beside each side of the opening."""
        wall = self.gate.wall or Wall()
        sides = wall.thickness / 2.0 * np.array([-1.0, 1.0])
        return _around(self.gate, wall, f"the wall of {self.gate.name}", sides)


@validated
def tilted_gate(
    position: VectorLike,
    heading: Angle = 0.0,
    elevation: Angle = 0.0,
    tilt: Angle = 0.0,
    width: Positive | None = None,
    height: Positive | None = None,
    name: Label = "gate",
    *,
    radius: Positive | None = None,
    polygon: Corners | None = None,
) -> Gate:
    """Return the gate whose attitude is given by angles.

    Args:
        position: centre of the opening [m], world, (3,).
        heading: of the direction of passage [rad], from x toward y.
        elevation: climb of the direction of passage [rad].
        tilt: roll about the direction of passage [rad], right-handed: 0 upright, π/2 with `up` to the right
            in the direction of passage, π upside down. The paper's α (Section II-D) is measured toward +y
            when passing toward +x: α = −tilt.
        width: of a rectangular opening [m], by default 1.
        height: of a rectangular opening [m], by default 0.6.
        name: by which stages refer to it.
        radius: of a round opening [m], instead of width and height.
        polygon: corners of any other convex opening [m], from `position` to the left and up, (K, 2).

    Raises:
        SpecError: a number is not finite, a side not positive, or the opening of two kinds.
    """
    normal, up = _directions(heading, elevation, tilt)
    return Gate(cast(Array, position), normal, up, width, height, name, radius=radius, polygon=polygon)


def in_opening(gate: Gate, clearance: float) -> tuple[Condition, ...]:
    """Return conditions for a position anywhere in a gate's opening, at a clearance [m] from its edges.

    Where the opening is too narrow for that, the position is fixed in the middle between the edges.
    """
    in_plane = float(gate.normal @ gate.position)
    bounds = gate.opening.at_clearance(clearance)
    directions = bounds.directions @ gate.plane_axes
    middles = directions @ gate.position
    return (
        Condition(Quantity.POSITION, gate.normal, in_plane, in_plane),
        *(
            Condition(Quantity.POSITION, direction, lower, upper)
            for direction, lower, upper in zip(
                directions, (middles + bounds.lower).tolist(), (middles + bounds.upper).tolist(), strict=True
            )
        ),
    )


def passed_gate(gates: Sequence[Gate], name: str | None, maneuver: str) -> Gate:
    """Return the gate of that name or, without a name, the only gate. Raises SpecError if there is none."""
    if name is not None:
        return named_gate(gates, name)
    if len(gates) != 1:
        raise SpecError(
            f"a {maneuver} passes one gate, there are {len(gates) or 'none'}; give one table "
            "[[gates]] with a position, or the name of its gate"
        )
    return gates[0]


def named_gate(gates: Sequence[Gate], name: str) -> Gate:
    """Return the gate of that name. Raises SpecError when there is none."""
    for gate in gates:
        if gate.name == name:
            return gate
    raise unknown_name("gate", name, [gate.name for gate in gates])


def _around(gate: Gate, wall: Wall, name: str, heights: Array) -> tuple[ConvexPiece, ...]:
    """Return the parts of a wall beside each side of a gate's opening, at heights [m] above its plane."""
    levels = gate.position + np.multiply.outer(heights, gate.normal)[:, None]
    parts = wall.parts(gate.opening)
    return tuple(
        ConvexPiece((levels + part @ gate.plane_axes).reshape(-1, 3), name=name, motion=gate.motion)
        for part in parts
    )


def _directions(heading: float, elevation: float, tilt: float) -> tuple[Array, Array]:
    """Return the direction of passage and the upright, unit vectors, (3,) each, for angles [rad]."""
    frame = axes_of(heading, elevation, tilt)
    return frame[:, 0], frame[:, 2]
