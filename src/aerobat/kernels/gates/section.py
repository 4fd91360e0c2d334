"""The section of an ellipsoid by a gate's plane, and its extent along a direction in the plane.

The ellipsoid is x = c + R A w, |w| ≤ 1, with attitude R and A = diag(semi-axes). For a unit vector d of the
world let d' = A Rᵀ d. The ellipsoid extends by σ = |n'| from its centre along the plane's normal n. With the
centre at a height h = n·c above the plane, the section is the ellipse of points w with n'·w = −h, |w| ≤ 1.
The section's centre is at d·c − h (d'·n')/σ² along any d in the plane. From its centre the section extends by
H √(1 − h²/σ²), with H² = d'·d' − (d'·n')²/σ².
"""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels.gates.snapshot import PlaceMotion
from aerobat.kernels.ops import TINY, Ops, Quaternion, Scalar, Vector, clip, magnitude
from aerobat.kernels.quaternions import axes, normalize, to_body
from aerobat.kernels.vectors import dot, norm

_ROUNDING = 1e-9  # [m] position from the middle within which no side is nearer, and smallest change of height


class BoundingEllipsoid(NamedTuple):
    """Ellipsoid that encloses a vehicle, aligned with its axes."""

    centre: Vector  # [m] from the centre of mass, body axes
    semi_axes: Vector  # [m]


class PlaneDirection(NamedTuple):
    """A direction in a gate's plane along which a body is measured, unit vectors in the world."""

    along: Vector
    beside: Vector  # also in the plane, a quarter turn further
    both_ways: Scalar  # 1 where the opposite direction counts too
    radial: Scalar  # 1 where the radial distance of the farthest point is measured, not its component


class GatePlane(NamedTuple):
    """A gate as a plane to be crossed at a planned time."""

    centre: Vector  # [m]
    normal: Vector  # unit vector in the direction of passage
    # directions in which a body is measured; empty for an unknown body
    directions: tuple[PlaneDirection, ...]
    radius: Scalar  # [m] radius of the circle around the opening
    planned: Scalar  # [s] planned time of the crossing
    window: Scalar  # [s] largest deviation of the crossing from that time
    depth: Scalar  # [m] distance beyond the plane that makes a crossing a passage
    motion: PlaceMotion | tuple[()] = ()  # motion of a moving gate


class Section(NamedTuple):
    """An ellipsoid and a plane, its section, and a direction in the plane with its perpendicular."""

    height: Scalar  # [m] of the centre above the plane
    reach: Scalar  # [m] of the ellipsoid along the normal
    along: Scalar  # [m] of the centre
    beside: Scalar  # [m] likewise
    shear_along: Scalar  # change of the section's centre with the height
    shear_beside: Scalar  # likewise
    half: Scalar  # [m] half extent of the section along the direction, through the centre
    covariance: Scalar  # [m²] covariance of along and beside in the section


class PlanePoint(NamedTuple):
    """A point in a gate's plane, from the centre of the opening."""

    along: Scalar  # [m]
    beside: Scalar  # [m]


def section(
    ops: Ops,
    ellipsoid: BoundingEllipsoid,
    directions: tuple[Vector, Vector, Vector],
    offset: Vector,
    q_world_body: Quaternion,
) -> Section:
    """Return the section of an ellipsoid by a plane.

    Args:
        ops: the arithmetic of the engine.
        ellipsoid: the ellipsoid around the vehicle.
        directions: the plane's normal, a direction in the plane, and its perpendicular, unit vectors, world.
        offset: position of the centre of mass relative to the opening's centre [m], world.
        q_world_body: the attitude, of any length except zero.
    """
    body_axes = axes(normalize(ops, q_world_body))
    in_body = [to_body(body_axes, direction) for direction in directions]
    height, along, beside = (
        dot(offset, direction) + dot(ellipsoid.centre, rotated)
        for direction, rotated in zip(directions, in_body, strict=True)
    )
    n, a, b = (_stretched(ellipsoid, direction) for direction in in_body)
    reach_sq = dot(n, n)
    shear_along, shear_beside = dot(a, n) / reach_sq, dot(b, n) / reach_sq
    return Section(
        height,
        ops.sqrt(reach_sq),
        along,
        beside,
        shear_along,
        shear_beside,
        ops.sqrt(ops.maximum(dot(a, a) - reach_sq * shear_along * shear_along, TINY)),
        dot(a, b) - reach_sq * shear_along * shear_beside,
    )


def extent(ops: Ops, ellipsoid: BoundingEllipsoid) -> Scalar:
    """Return an upper bound [m] of the distance of the ellipsoid's points from the centre of mass."""
    x, y, z = ellipsoid.semi_axes
    return norm(ops, ellipsoid.centre) + ops.maximum(ops.maximum(x, y), z)


def gap(ops: Ops, at: Section) -> Scalar:
    """Return the distance between ellipsoid and plane [m]; negative where they meet."""
    return magnitude(ops, at.height) - at.reach


def farthest(ops: Ops, at: Section, both_ways: Scalar) -> PlanePoint:
    """Return the section's point farthest along the direction.

    With `both_ways` it is the farthest point on the side of the section's centre. Where ellipsoid and plane
    do not meet, the ellipsoid's point nearest to the plane is returned.
    """
    relative = at.height / at.reach
    size = ops.sqrt(ops.maximum(1.0 - relative * relative, 0.0))
    along, beside = at.along - at.height * at.shear_along, at.beside - at.height * at.shear_beside
    sided = ops.select(_is_against(along, both_ways), -size, size)
    return PlanePoint(along + sided * at.half, beside + sided * at.covariance / at.half)


def fraction_of_farthest(
    ops: Ops, at: Section, change: tuple[Scalar, Scalar], within: tuple[Scalar, Scalar], both_ways: Scalar
) -> Scalar:
    """Return the fraction of a straight path, with end `at`, at which a section has its largest extent.

    With the attitude of the end, the extent is a linear function of the height h plus or minus H √(1 −
    h²/σ²). This concave function has its maximum in closed form.

    Args:
        ops: the arithmetic of the engine.
        at: the section at the end of the path.
        change: displacement of the centre along the normal and along the direction [m].
        within: the smallest and the largest allowed fraction.
        both_ways: 1 where the opposite direction counts, if the section's centre lies there.
    """
    rise, drift = change
    rise = ops.select(magnitude(ops, rise) < _ROUNDING, _ROUNDING, rise)
    sheared = drift - rise * at.shear_along
    middle = 1.0 - 0.5 * (within[0] + within[1])
    along = at.along - at.height * at.shear_along - middle * sheared
    slope = ops.select(_is_against(along, both_ways), -sheared, sheared) * at.reach / (at.half * rise)
    height = at.reach * slope / ops.sqrt(1.0 + slope * slope)
    return clip(ops, 1.0 + (height - at.height) / rise, *within)


def _is_against(along: Scalar, both_ways: Scalar) -> Scalar:
    """Return True where the opposite direction counts and the section's centre lies there."""
    return (along < -_ROUNDING) & (both_ways > 0.5)


def _stretched(ellipsoid: BoundingEllipsoid, direction: Vector) -> Vector:
    """Return A Rᵀ d for a direction d in body axes."""
    x, y, z = (axis * part for axis, part in zip(ellipsoid.semi_axes, direction, strict=True))
    return x, y, z
