"""The section of an ellipsoid by a gate's plane: how far it reaches along a direction in that.

The ellipsoid is x = c + R A w, |w| ≤ 1, with attitude R and A = diag(semi-axes). For a unit vector d of the
world d' = A Rᵀ d. The ellipsoid reaches σ = |n'| from its centre along the plane's normal n. With the centre
at a height h = n·c above the plane, the section is the ellipse of points w with n'·w = −h, |w| ≤ 1. The
section's centre is at d·c − h (d'·n')/σ² along any d in the plane. From there the section reaches
H √(1 − h²/σ²) with H² = d'·d' − (d'·n')²/σ².
"""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels.ops import TINY, Ops, Quaternion, Scalar, Vector, clip, magnitude
from aerobat.kernels.quaternions import axes, normalize, to_body
from aerobat.kernels.vectors import dot, norm

_ROUNDING = 1e-9  # [m] from the middle, where neither side is the nearer; of a rise that is none


class BoundingEllipsoid(NamedTuple):
    """Ellipsoid that encloses a vehicle, aligned with its axes."""

    centre: Vector  # [m] from the centre of mass, body axes
    semi_axes: Vector  # [m]


class PlaneDirection(NamedTuple):
    """A direction in a gate's plane along which a body is measured, unit vectors in the world."""

    along: Vector
    beside: Vector  # in the plane too, a quarter of a turn on
    both_ways: Scalar  # 1 where against it counts too
    radial: Scalar  # 1 where the distance of the point that reaches the farthest counts, not how far


class Section(NamedTuple):
    """An ellipsoid above a plane, its section, and a direction in that plane with the one beside it."""

    height: Scalar  # [m] of the centre above the plane
    reach: Scalar  # [m] of the ellipsoid along the normal
    along: Scalar  # [m] of the centre
    beside: Scalar  # [m] likewise
    shear_along: Scalar  # by which the section's centre moves with the height
    shear_beside: Scalar  # likewise
    half: Scalar  # [m] that the section reaches along the direction, through the centre
    covariance: Scalar  # [m²] of along and beside there


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
    """The section of an ellipsoid by a plane.

    Args:
        ops: of the arithmetic.
        ellipsoid: what encloses the vehicle.
        directions: the plane's normal, a direction in it, and the one beside that, unit vectors, world.
        offset: of the centre of mass from the opening's centre [m], world.
        q_world_body: the attitude, of any length but zero.
    """
    body_axes = axes(normalize(ops, q_world_body))
    in_body = [to_body(body_axes, direction) for direction in directions]
    height, along, beside = (
        dot(offset, direction) + dot(ellipsoid.centre, turned)
        for direction, turned in zip(directions, in_body, strict=True)
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
    """The distance [m] from the centre of mass that no point of the ellipsoid exceeds."""
    x, y, z = ellipsoid.semi_axes
    return norm(ops, ellipsoid.centre) + ops.maximum(ops.maximum(x, y), z)


def gap(ops: Ops, at: Section) -> Scalar:
    """The distance between ellipsoid and plane [m]; negative where they meet."""
    return magnitude(ops, at.height) - at.reach


def farthest(ops: Ops, at: Section, both_ways: Scalar) -> PlanePoint:
    """The section's point farthest along the direction; both ways, to the side where the section's centre is.

    Where the plane is not met, of the point of the ellipsoid next to it.
    """
    relative = at.height / at.reach
    size = ops.sqrt(ops.maximum(1.0 - relative * relative, 0.0))
    along, beside = at.along - at.height * at.shear_along, at.beside - at.height * at.shear_beside
    sided = ops.select(_is_against(along, both_ways), -size, size)
    return PlanePoint(along + sided * at.half, beside + sided * at.covariance / at.half)


def fraction_of_farthest(
    ops: Ops,
    at: Section,
    change: tuple[Scalar, Scalar],
    within: tuple[Scalar, Scalar],
    both_ways: Scalar,
) -> Scalar:
    """The fraction of a straight way, its end at `at`, at which a section reaches the farthest.

    With the attitude as at the end the section reaches a linear function of the height h more or less
    H √(1 − h²/σ²): a concave function, with its maximum in closed form.

    Args:
        ops: of the arithmetic.
        at: at the end of the way.
        change: of the centre on the way, along the normal and along the direction [m].
        within: the least and the greatest fraction to choose from.
        both_ways: 1 where the farthest against the direction is meant, if the section's centre is there.
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
    """True where the other way counts, and the section's centre lies there."""
    return (along < -_ROUNDING) & (both_ways > 0.5)


def _stretched(ellipsoid: BoundingEllipsoid, direction: Vector) -> Vector:
    """A Rᵀ d, for a direction d in body axes."""
    x, y, z = (axis * part for axis, part in zip(ellipsoid.semi_axes, direction, strict=True))
    return x, y, z
