"""Rotations as unit Hamilton quaternions (w, x, y, z), body to world; leading axes broadcast.

The face for arrays of `kernels.quaternions`, with what takes more than arithmetic: exponential and logarithm.
Conventions: Solà, "Quaternion kinematics for the error-state Kalman filter", arXiv:1711.02508.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from aerobat.arrays import Array
from aerobat.kernels import quaternions, vectors
from aerobat.kernels.ops import Quaternion, Vector

IDENTITY: Array = np.array([1.0, 0.0, 0.0, 0.0])
IDENTITY.flags.writeable = False
UP: Array = np.array([0.0, 0.0, 1.0])  # e3, the thrust axis in the body and the vertical in the world
UP.flags.writeable = False


def cross(a: ArrayLike, b: ArrayLike) -> Array:
    """a × b, (..., 3); several times faster than np.cross on few vectors."""
    return _joined(vectors.cross(_vector(a), _vector(b)))


def multiply(p: ArrayLike, q: ArrayLike) -> Array:
    """Hamilton product p ⊗ q, (..., 4)."""
    return _joined(quaternions.multiply(_quaternion(p), _quaternion(q)))


def conjugate(q: ArrayLike) -> Array:
    """The inverse rotation q*, (..., 4)."""
    return np.asarray(np.asarray(q, dtype=float) * np.array([1.0, -1.0, -1.0, -1.0]))


def normalize(q: ArrayLike) -> Array:
    """q / |q|, (..., 4)."""
    q = np.asarray(q, dtype=float)
    return np.asarray(q / _length(q)[..., None])


def rotate(q: ArrayLike, v: ArrayLike) -> Array:
    """q ⊗ v ⊗ q*: body vectors (..., 3) to the world for q = q_world_body."""
    return _joined(quaternions.rotate(_quaternion(q), _vector(v)))


def unrotate(q: ArrayLike, v: ArrayLike) -> Array:
    """q* ⊗ v ⊗ q: world vectors (..., 3) to the body for q = q_world_body."""
    return _joined(quaternions.rotate(quaternions.conjugate(_quaternion(q)), _vector(v)))


def exp(phi: ArrayLike) -> Array:
    """The quaternion of a rotation vector phi [rad], (..., 3) -> (..., 4)."""
    phi = np.asarray(phi, dtype=float)
    angle = np.linalg.norm(phi, axis=-1, keepdims=True)
    # sin(a/2)/a through NumPy's sinc, finite at zero
    return np.concatenate([np.cos(angle / 2), 0.5 * np.sinc(angle / (2 * np.pi)) * phi], axis=-1)


def log(q: ArrayLike) -> Array:
    """The shortest rotation vector of q [rad], angle in [0, π], (..., 4) -> (..., 3)."""
    q = np.asarray(q, dtype=float)
    q = np.where(q[..., :1] < 0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    half = np.arctan2(sine, q[..., :1])
    factor = np.where(sine > 1e-12, 2 * half / np.where(sine > 1e-12, sine, 1.0), 2.0)
    return np.asarray(factor * q[..., 1:])


def box_minus(q: ArrayLike, p: ArrayLike) -> Array:
    """Log(p* ⊗ q): the rotation from p to q as a vector in p's body axes [rad], (..., 3)."""
    return log(multiply(conjugate(p), q))


def angle_between(p: ArrayLike, q: ArrayLike) -> Array:
    """The angle of the relative rotation [rad], in [0, π], (...)."""
    return np.asarray(np.linalg.norm(box_minus(q, p), axis=-1))


def twist(p: ArrayLike, q: ArrayLike) -> Array:
    """The angle [rad] by which the rotation from p to q turns about the body's z, (...).

    It is that of the swing-twist decomposition of p* ⊗ q: what is left is a rotation about an axis across z.
    """
    turn = multiply(conjugate(p), q)
    return np.asarray(2.0 * np.arctan2(turn[..., 3], turn[..., 0]))


def axes(q: ArrayLike) -> Array:
    """The rotation matrix of q, (..., 4) -> (..., 3, 3); its columns are the body axes in the world."""
    b1, b2, b3 = (_joined(axis) for axis in quaternions.axes(_quaternion(q)))
    return np.stack([b1, b2, b3], axis=-1)


def thrust_axis(q: ArrayLike) -> Array:
    """The body's z axis in the world, b3, (..., 4) -> (..., 3)."""
    return rotate(q, np.array([0.0, 0.0, 1.0]))


def about_axis(axis: ArrayLike, angle: ArrayLike) -> Array:
    """The rotation by `angle` [rad] (...) about the unit vector `axis` (..., 3)."""
    half = np.asarray(angle, dtype=float) / 2
    axis = np.asarray(axis, dtype=float)
    q = np.empty((*np.broadcast_shapes(half.shape, axis.shape[:-1]), 4))
    q[..., 0] = np.cos(half)
    q[..., 1:] = np.sin(half)[..., None] * axis
    return q


def smallest_rotation(a: ArrayLike, b: ArrayLike) -> Array:
    """The smallest rotation that takes unit vector a to unit vector b, (..., 3) -> (..., 4).

    Opposite vectors leave its axis open; any axis normal to a is then as small, and one is chosen.
    """
    a, b = np.broadcast_arrays(np.asarray(a, dtype=float), np.asarray(b, dtype=float))
    # half-way vector h = (a + b)/|a + b|: q = (a·h, a × h) with a·h = |a + b|/2, which stays accurate where
    # a + b is hardly more than rounding
    h = a + b
    norm = _length(h)
    opposite = norm < 1e-12
    if opposite.any():
        h = np.where(opposite[..., None], _any_normal(a), h)
    h = h / np.where(opposite, 1.0, norm)[..., None]
    cosine = np.where(opposite, 0.0, norm / 2.0)
    return normalize(_joined((cosine, *vectors.cross(_vector(a), _vector(h)))))


def _any_normal(a: Array) -> Array:
    """A unit vector normal to a: for a = ±z it is -y, so that the smallest flip is a half roll."""
    # remove from the candidate axis least aligned with a its part along a
    candidate = np.where(np.abs(a[..., 1:2]) < 0.9, [0.0, -1.0, 0.0], [1.0, 0.0, 0.0])
    normal = candidate - np.sum(candidate * a, axis=-1, keepdims=True) * a
    return np.asarray(normal / np.linalg.norm(normal, axis=-1, keepdims=True))


def _length(array: Array) -> Array:
    return np.asarray(np.sqrt(np.einsum("...i,...i->...", array, array)))


def _vector(array: ArrayLike) -> Vector:
    array = np.asarray(array, dtype=float)
    return array[..., 0], array[..., 1], array[..., 2]


def _quaternion(array: ArrayLike) -> Quaternion:
    array = np.asarray(array, dtype=float)
    return array[..., 0], array[..., 1], array[..., 2], array[..., 3]


def _joined(components: tuple[Any, ...]) -> Array:
    return np.stack(components, axis=-1)
