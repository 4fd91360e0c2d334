"""The attitude law of an autopilot: it turns no faster than the rotors can stop it in time.

From an error θ, an angular deceleration a that sets in a lag τ later stops what turns at ω with
ω τ + ω²/(2 a) = θ; so ω = √(a² τ² + 2 a θ) − a τ is the most that is commanded. For small errors the usual
law commands less, and it is that one. ArduPilot's attitude controller limits its rates by a root likewise.

The thrust axis is brought to where it should be by the shortest way, and the body turned about it once it is
near [BD].
"""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels.control_loops import AttitudeCommand, AttitudeError, Gains
from aerobat.kernels.ops import TINY, Axes, Ops, Scalar, magnitude
from aerobat.kernels.quaternions import conjugate, multiply, to_body
from aerobat.kernels.rigid_body import Body
from aerobat.kernels.vectors import subtract

_STOPPING = 0.7  # [-] of the angular acceleration that a hovering vehicle has, which is counted on
_MAX_YAW_RATE = 4.0  # [rad/s] for an error of yaw: rotors that lag cannot tilt a body that spins faster
_OPPOSITE = 1e-6  # [-] cosine of half a tilt, below which yaw means nothing


class Authority(NamedTuple):
    """The angular accelerations that the rotors of a hovering vehicle can give, and their lag."""

    tilt: Scalar  # [rad/s²] in roll and pitch
    yaw: Scalar  # [rad/s²]
    lag: Scalar  # [s] until they do it


def slope_limited_error(
    ops: Ops, gains: Gains, authority: Authority, body: Body, body_axes: Axes, attitude: AttitudeCommand
) -> AttitudeError:
    """Distance of the body from its desired attitude and rates, as far as it may be answered.

    Args:
        ops: of the arithmetic.
        gains: of the attitude loop.
        authority: of the rotors.
        body: as it is now.
        body_axes: its axes.
        attitude: what is commanded.
    """
    q = multiply(conjugate(body.q_world_body), attitude.q_world_body)
    sign = ops.select(q[0] < 0.0, -1.0, 1.0)
    w, x, y, z = (sign * part for part in q)
    upright = ops.sqrt(w * w + z * z)  # the cosine of half the tilt
    turned = upright > _OPPOSITE
    c = ops.select(turned, w / ops.maximum(upright, _OPPOSITE), 1.0)  # of half the yaw, the cosine
    s = ops.select(turned, z / ops.maximum(upright, _OPPOSITE), 0.0)  # and the sine
    tilt = _answered(ops, gains, ops.sqrt(x * x + y * y), authority.tilt, authority.lag)
    yaw = _answered(ops, gains, magnitude(ops, s), authority.yaw, authority.lag)
    yaw = ops.minimum(yaw, _MAX_YAW_RATE * gains.damping / (gains.stiffness * magnitude(ops, s) + TINY))
    level = ops.maximum(2.0 * upright * upright - 1.0, 0.0)  # the cosine of the tilt; yaw waits for it
    omega = to_body(body_axes, attitude.omega)
    rotation = tilt * (c * x - s * y), tilt * (c * y + s * x), level * level * yaw * s
    return AttitudeError(rotation, subtract(omega, body.omega_body))


def _answered(ops: Ops, gains: Gains, half: Scalar, acceleration: Scalar, lag: Scalar) -> Scalar:
    """The part of an error [-] that the attitude loop may answer.

    Args:
        ops: of the arithmetic.
        gains: they command stiffness·half/damping as the rate [rad/s].
        half: sin(θ/2) [-], whose double is no more than the error θ.
        acceleration: [rad/s²] that stops it.
        lag: [s] until it does.
    """
    a = _STOPPING * acceleration
    # (√(a² τ² + 4 a s) − a τ) / s, without the difference
    slope = 4.0 * a / (a * lag + ops.sqrt(a * a * lag * lag + 4.0 * a * half) + TINY)
    return ops.minimum(1.0, slope * gains.damping / (gains.stiffness + TINY))
