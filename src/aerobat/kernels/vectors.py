"""Vectors, matrices and quaternions in components; the scalar twins of `aerobat.so3`."""

from __future__ import annotations

import math
from functools import reduce

from aerobat.kernels.ops import Axes, Matrix, Ops, Quaternion, Scalar, Vector

ZERO: Vector = (0.0, 0.0, 0.0)
_TINY = 1e-300  # keeps 0/0 away and changes no other quotient
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


def add(a: Vector, b: Vector) -> Vector:
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def subtract(a: Vector, b: Vector) -> Vector:
    """a − b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scale(s: Scalar, a: Vector) -> Vector:
    """s·a."""
    return s * a[0], s * a[1], s * a[2]


def add_scaled(a: Vector, s: Scalar, b: Vector) -> Vector:
    """a + s·b."""
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]


def dot(a: Vector, b: Vector) -> Scalar:
    """a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def length(ops: Ops, a: Vector) -> Scalar:
    """|a|."""
    return ops.sqrt(dot(a, a))


def cross(a: Vector, b: Vector) -> Vector:
    """a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def transform(m: Matrix, a: Vector) -> Vector:
    """The matrix-vector product m·a."""
    return dot(m[0], a), dot(m[1], a), dot(m[2], a)


def within(ops: Ops, a: Vector, longest: Scalar) -> Vector:
    """`a`, shortened to the length `longest` where it is longer; its direction is kept."""
    return scale(longest / (ops.maximum(length(ops, a), longest) + _TINY), a)


def multiply(p: Quaternion, q: Quaternion) -> Quaternion:
    """The Hamilton product p ⊗ q."""
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    return (
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    )


def spinning(q: Quaternion, omega_body: Vector) -> Quaternion:
    """The rate of change of an attitude, q' = ½ q ⊗ (0, ω)."""
    w, x, y, z = q
    a, b, c = scale(0.5, omega_body)
    return -x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a


def conjugate(q: Quaternion) -> Quaternion:
    """The inverse rotation q*."""
    return q[0], -q[1], -q[2], -q[3]


def normalize(ops: Ops, q: Quaternion) -> Quaternion:
    """q / |q|."""
    w, x, y, z = q
    inverse = 1.0 / ops.sqrt(w * w + x * x + y * y + z * z)
    return w * inverse, x * inverse, y * inverse, z * inverse


def axes(q: Quaternion) -> Axes:
    """The body axes b1, b2, b3 in the world, for q = q_world_body: columns of the rotation matrix."""
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
    """A world vector in body axes, Rᵀ·a."""
    b1, b2, b3 = body_axes
    return dot(b1, a), dot(b2, a), dot(b3, a)


def to_world(body_axes: Axes, a: Vector) -> Vector:
    """A body vector in world axes, R·a."""
    b1, b2, b3 = body_axes
    return add_scaled(add_scaled(scale(a[0], b1), a[1], b2), a[2], b3)


def angle_between(ops: Ops, p: Quaternion, q: Quaternion) -> Scalar:
    """The angle of the rotation from attitude p to attitude q [rad], in [0, π]."""
    w, *vector = multiply(conjugate(p), q)
    return 2.0 * arc_tangent(ops, length(ops, tuple(vector)), ops.maximum(w, -w))


def arc_tangent(ops: Ops, y: Scalar, x: Scalar) -> Scalar:
    """The angle [rad] in [0, π/2] whose tangent is y/x, for y and x of zero or more, not both zero."""
    ratio = ops.minimum(x, y) / ops.maximum(x, y)
    large = ratio > _EIGHTH
    t = ops.select(large, (ratio - 1.0) / (ratio + 1.0), ratio)
    square = t * t
    p, q = reduce(lambda v, c: v * square + c, _ARC_P), reduce(lambda v, c: v * square + c, _ARC_Q)
    angle = ops.select(large, 0.25 * math.pi, 0.0) + (t + t * square * p / q)
    return ops.select(y > x, 0.5 * math.pi - angle, angle)


def smallest_rotation(ops: Ops, a: Vector, b: Vector, normal: Vector) -> Quaternion:
    """The smallest rotation that takes unit vector a to unit vector b.

    Opposite vectors leave its axis open: the half turn about `normal`, a unit vector normal to a, is taken.
    """
    # half-way vector h = (a + b)/|a + b|: q = (a·h, a × h) with a·h = |a + b|/2, which stays accurate where
    # a + b is hardly more than rounding
    h = add(a, b)
    square = dot(h, h)
    opposite = square < 1e-24
    shrink = 1.0 / ops.sqrt(ops.select(opposite, 1.0, square))
    x, y, z = cross(a, h)
    return (
        ops.select(opposite, 0.0, 0.5 * square * shrink),
        ops.select(opposite, normal[0], x * shrink),
        ops.select(opposite, normal[1], y * shrink),
        ops.select(opposite, normal[2], z * shrink),
    )
