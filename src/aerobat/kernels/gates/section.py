"""The section of an ellipsoid by a gate's plane: how far it reaches across the opening and up in it.

The ellipsoid is x = c + R A w, |w| ≤ 1, with attitude R and A = diag(semi-axes). For a unit vector d of the
world d' = A Rᵀ d; then σ = |n'| is how far it reaches from its centre along the plane's normal n, and with
the centre at a height s = n·c above the plane the section is the ellipse of points w with n'·w = −s, |w| ≤ 1:
its centre is at d·c − s (d'·n')/σ² along any d in the plane, and from there it reaches
√(1 − s²/σ²) √(d'·d' − (d'·n')²/σ²).
"""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels.ops import Ops, Quaternion, Scalar, Vector
from aerobat.kernels.quaternions import axes, normalize, to_body
from aerobat.kernels.vectors import dot, norm

_TINY = 1e-300  # keeps 0/0 away and changes no other quotient
_ROUNDING = 1e-9  # [m] from the middle, where neither side is the nearer


class BoundingEllipsoid(NamedTuple):
    """What encloses a vehicle, aligned with its axes."""

    centre: Vector  # [m] from the centre of mass, body axes
    semi_axes: Vector  # [m]


class GateFrame(NamedTuple):
    """The axes of a gate, unit vectors in the world."""

    normal: Vector  # direction of passage
    lateral: Vector  # to the left of who passes upright
    up: Vector


class PlanePoint(NamedTuple):
    """A point in a gate's plane, from the centre of the opening."""

    lateral: Scalar  # [m]
    up: Scalar  # [m]


def plane_gap(
    ops: Ops, ellipsoid: BoundingEllipsoid, frame: GateFrame, offset: Vector, q_world_body: Quaternion
) -> Scalar:
    """The distance between an ellipsoid and a gate's plane [m]; negative where they meet.

    Args:
        ops: of the arithmetic.
        ellipsoid: what encloses the vehicle.
        frame: the gate's.
        offset: of the centre of mass from the opening's centre [m], world.
        q_world_body: the attitude.
    """
    normal = to_body(axes(q_world_body), frame.normal)
    height = dot(offset, frame.normal) + dot(ellipsoid.centre, normal)
    return ops.maximum(height, -height) - norm(ops, _stretched(ellipsoid, normal))


def section_extremes(
    ops: Ops, ellipsoid: BoundingEllipsoid, frame: GateFrame, offset: Vector, q_world_body: Quaternion
) -> tuple[PlanePoint, PlanePoint]:
    """The points of an ellipsoid's section farthest from the opening's middle: across it, and up or down.

    Where the plane is not met, those of the section's nearest point to it.

    Args:
        ops: of the arithmetic.
        ellipsoid: what encloses the vehicle.
        frame: the gate's.
        offset: of the centre of mass from the opening's centre [m], world.
        q_world_body: the attitude, of any length but zero.
    """
    body_axes = axes(normalize(ops, q_world_body))
    normal, lateral, up = (to_body(body_axes, axis) for axis in frame)
    height, across, above = (
        dot(offset, axis) + dot(ellipsoid.centre, in_body)
        for axis, in_body in zip(frame, (normal, lateral, up), strict=True)
    )
    normal, lateral, up = (_stretched(ellipsoid, axis) for axis in (normal, lateral, up))
    reach_sq = dot(normal, normal)
    shear_lateral, shear_up = dot(lateral, normal) / reach_sq, dot(up, normal) / reach_sq
    size = ops.sqrt(ops.maximum(1.0 - height * height / reach_sq, 0.0))
    across, above = across - height * shear_lateral, above - height * shear_up
    half_width, half_height = (
        ops.sqrt(ops.maximum(dot(axis, axis) - reach_sq * shear * shear, _TINY))
        for axis, shear in ((lateral, shear_lateral), (up, shear_up))
    )
    covariance = dot(lateral, up) - reach_sq * shear_lateral * shear_up
    to_side = ops.select(across < -_ROUNDING, -size, size)
    upward = ops.select(above < -_ROUNDING, -size, size)
    return (
        PlanePoint(across + to_side * half_width, above + to_side * covariance / half_width),
        PlanePoint(across + upward * covariance / half_height, above + upward * half_height),
    )


def _stretched(ellipsoid: BoundingEllipsoid, direction: Vector) -> Vector:
    """A Rᵀ d, for a direction d in body axes."""
    x, y, z = (axis * part for axis, part in zip(ellipsoid.semi_axes, direction, strict=True))
    return x, y, z
