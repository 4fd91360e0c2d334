"""Vectors and matrices in components."""

from __future__ import annotations

from aerobat.kernels.ops import TINY, Matrix, Ops, Scalar, Vector, clip

ZERO: Vector = (0.0, 0.0, 0.0)


def add(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def subtract(a: Vector, b: Vector) -> Vector:
    """Return a − b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scale(s: Scalar, a: Vector) -> Vector:
    """Return s·a."""
    return s * a[0], s * a[1], s * a[2]


def add_scaled(a: Vector, s: Scalar, b: Vector) -> Vector:
    """Return a + s·b."""
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]


def dot(a: Vector, b: Vector) -> Scalar:
    """Return a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def norm(ops: Ops, a: Vector) -> Scalar:
    """Return |a|."""
    return ops.sqrt(dot(a, a))


def cross(a: Vector, b: Vector) -> Vector:
    """Return a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def transform(m: Matrix, a: Vector) -> Vector:
    """Return the matrix-vector product m·a."""
    return dot(m[0], a), dot(m[1], a), dot(m[2], a)


def low_passed(before: Vector, now: Vector, time_constant: Scalar, elapsed: Scalar) -> Vector:
    """Return a first-order low-pass of `now`, `elapsed` [s] after its output was `before`."""
    return add_scaled(before, elapsed / (time_constant + elapsed), subtract(now, before))


def clip_components(ops: Ops, a: Vector, limit: Scalar) -> Vector:
    """Return `a` with each component clipped to [−limit, limit]."""
    return clip(ops, a[0], -limit, limit), clip(ops, a[1], -limit, limit), clip(ops, a[2], -limit, limit)


def clamp_norm(ops: Ops, a: Vector, longest: Scalar) -> Vector:
    """Return `a`, shortened to the length `longest` where it is longer."""
    return scale(longest / (ops.maximum(norm(ops, a), longest) + TINY), a)
