"""Unit quaternions in components, for any arithmetic; `aerobat.so3` is their interface for arrays.

Hamilton's convention, (w, x, y, z), body to world: Solà, arXiv:1711.02508.
"""

from __future__ import annotations

import math
from functools import reduce

from aerobat.kernels.ops import Axes, Ops, Quaternion, Scalar, Vector, select_tree
from aerobat.kernels.vectors import add, add_scaled, cross, dot, norm, scale

# the arc tangent is x + x³ P(x²)/Q(x²) for |x| ≤ tan(π/8), highest power first (Cephes library, S. Moshier)
_ARC_P = (
    -0.8750608600031904,
    -16.157537187333652,
    -75.00855792314705,
    -122.88666844901361,
    -64.85021904942025,
)
_ARC_Q = (
    1.0,
    24.858464901423062,
    165.02700983169885,
    432.88106049129027,
    485.3903996359137,
    194.5506571482614,
)
_EIGHTH = 0.4142135623730951  # tan(π/8)


def multiply(p: Quaternion, q: Quaternion) -> Quaternion:
    """Return the Hamilton product p ⊗ q."""
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    return (
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    )


def quaternion_rate(q: Quaternion, omega_body: Vector) -> Quaternion:
    """Return the time derivative of an attitude, q' = ½ q ⊗ (0, ω)."""
    w, x, y, z = q
    a, b, c = scale(0.5, omega_body)
    return -x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a


def exp_of_small(phi: Vector) -> Quaternion:
    """Return the quaternion of a rotation vector [rad] by series, to rounding up to 0.2, to 1e-9 up to 1."""
    square = 0.25 * dot(phi, phi)  # of half the angle
    cosine = 1.0 - square * (1.0 / 2.0 - square * (1.0 / 24.0 - square * (1.0 / 720.0 - square / 40320.0)))
    sinc = 1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0 - square * (1.0 / 5040.0 - square / 362880.0)))
    x, y, z = scale(0.5 * sinc, phi)
    return cosine, x, y, z


def conjugate(q: Quaternion) -> Quaternion:
    """Return the inverse rotation q*."""
    return q[0], -q[1], -q[2], -q[3]


def normalize(ops: Ops, q: Quaternion) -> Quaternion:
    """Return q / |q|."""
    w, x, y, z = q
    inverse = 1.0 / ops.sqrt(w * w + x * x + y * y + z * z)
    return w * inverse, x * inverse, y * inverse, z * inverse


def rotate(q: Quaternion, a: Vector) -> Vector:
    """Return q ⊗ a ⊗ q*: a body vector in world axes for q = q_world_body."""
    w, x, y, z = q
    u = (x, y, z)
    t = scale(2.0, cross(u, a))
    return add(add_scaled(a, w, t), cross(u, t))


def axes(q: Quaternion) -> Axes:
    """Return the body axes b1, b2, b3 in the world for q = q_world_body: columns of the rotation matrix."""
    w, x, y, z = q
    x2, y2, z2 = 2.0 * x, 2.0 * y, 2.0 * z
    xx, yy, zz = x * x2, y * y2, z * z2
    xy, xz, yz = x * y2, x * z2, y * z2
    wx, wy, wz = w * x2, w * y2, w * z2
    return (
        (1.0 - yy - zz, xy + wz, xz - wy),
        (xy - wz, 1.0 - xx - zz, yz + wx),
        (xz + wy, yz - wx, 1.0 - xx - yy),
    )


def to_body(body_axes: Axes, a: Vector) -> Vector:
    """Return a world vector in body axes, Rᵀ·a."""
    b1, b2, b3 = body_axes
    return dot(b1, a), dot(b2, a), dot(b3, a)


def to_world(body_axes: Axes, a: Vector) -> Vector:
    """Return a body vector in world axes, R·a."""
    b1, b2, b3 = body_axes
    return add_scaled(add_scaled(scale(a[0], b1), a[1], b2), a[2], b3)


def angle_between(ops: Ops, p: Quaternion, q: Quaternion) -> Scalar:
    """Return the angle of the rotation from attitude p to attitude q [rad], in [0, π]."""
    w, x, y, z = multiply(conjugate(p), q)
    return 2.0 * atan2(ops, norm(ops, (x, y, z)), ops.maximum(w, -w))


def atan2(ops: Ops, y: Scalar, x: Scalar) -> Scalar:
    """Return the angle [rad] in [0, π/2] whose tangent is y/x, for nonnegative y and x, not both zero."""
    ratio = ops.minimum(x, y) / ops.maximum(x, y)
    large = ratio > _EIGHTH
    t = ops.select(large, (ratio - 1.0) / (ratio + 1.0), ratio)
    square = t * t
    p, q = reduce(lambda v, c: v * square + c, _ARC_P), reduce(lambda v, c: v * square + c, _ARC_Q)
    angle = ops.select(large, 0.25 * math.pi, 0.0) + (t + t * square * p / q)
    return ops.select(y > x, 0.5 * math.pi - angle, angle)


def smallest_rotation(ops: Ops, a: Vector, b: Vector, normal: Vector) -> Quaternion:
    """Return the smallest rotation that takes unit vector a to unit vector b.

    For opposite vectors the axis is not unique: the half turn about `normal`, a unit vector normal to a, is
    returned.
    """
    # half-way vector h = (a + b)/|a + b|: q = (a·h, a × h) with a·h = |a + b|/2, which stays accurate where
    # a + b is hardly more than rounding
    h = add(a, b)
    square = dot(h, h)
    opposite = square < 1e-24
    shrink = 1.0 / ops.sqrt(ops.select(opposite, 1.0, square))
    x, y, z = scale(shrink, cross(a, h))
    return select_tree(ops, opposite, (0.0, *normal), (0.5 * square * shrink, x, y, z))
