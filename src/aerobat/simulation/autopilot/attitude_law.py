"""The attitude law of an autopilot: body rates are limited so that the rotors can stop them in time.

A body at rate ω that decelerates by a after a lag τ stops within the angle ω τ + ω²/(2 a). To stop within the
error θ, the commanded rate is at most ω = √(a² τ² + 2 a θ) − a τ. For small errors the usual proportional law
commands less and applies. ArduPilot's attitude controller limits its rates by a square root likewise.

The thrust axis is turned by the shortest way to its direction, and the body is yawed about it once the thrust
axis is near [BD].
"""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels.control_loops import AttitudeCommand, AttitudeError, Gains
from aerobat.kernels.ops import TINY, Axes, Ops, Scalar, magnitude
from aerobat.kernels.quaternions import conjugate, multiply, to_body
from aerobat.kernels.rigid_body import Body
from aerobat.kernels.vectors import subtract

_STOPPING_FRACTION = 0.7  # [-] fraction used of a hovering vehicle's angular acceleration
_MAX_YAW_RATE = 4.0  # [rad/s] largest commanded yaw rate: lagging rotors cannot tilt a body that spins faster
_MIN_HALF_COSINE = 1e-6  # [-] cosine of half the tilt, below which yaw is undefined


class Authority(NamedTuple):
    """The angular accelerations that the rotors of a hovering vehicle can give, and their lag."""

    tilt: Scalar  # [rad/s²] in roll and pitch
    yaw: Scalar  # [rad/s²]
    lag: Scalar  # [s] lag of the rotors


def limited_attitude_error(
    ops: Ops, gains: Gains, authority: Authority, body: Body, body_axes: Axes, attitude: AttitudeCommand
) -> AttitudeError:
    """Return the error of attitude and body rates, limited to the part that may be answered.

    Args:
        ops: of the arithmetic.
        gains: of the attitude loop.
        authority: of the rotors.
        body: the present state.
        body_axes: its axes.
        attitude: the commanded attitude.
    """
    q = multiply(conjugate(body.q_world_body), attitude.q_world_body)
    sign = ops.select(q[0] < 0.0, -1.0, 1.0)
    w, x, y, z = (sign * part for part in q)
    upright = ops.sqrt(w * w + z * z)  # the cosine of half the tilt
    turned = upright > _MIN_HALF_COSINE
    c = ops.select(turned, w / ops.maximum(upright, _MIN_HALF_COSINE), 1.0)  # of half the yaw, the cosine
    s = ops.select(turned, z / ops.maximum(upright, _MIN_HALF_COSINE), 0.0)  # and the sine
    tilt = _limited_fraction(ops, gains, ops.sqrt(x * x + y * y), authority.tilt, authority.lag)
    yaw = _limited_fraction(ops, gains, magnitude(ops, s), authority.yaw, authority.lag)
    yaw = ops.minimum(yaw, _MAX_YAW_RATE * gains.damping / (gains.stiffness * magnitude(ops, s) + TINY))
    level = ops.maximum(2.0 * upright * upright - 1.0, 0.0)  # the cosine of the tilt; yaw waits for it
    omega = to_body(body_axes, attitude.omega)
    rotation = tilt * (c * x - s * y), tilt * (c * y + s * x), level * level * yaw * s
    return AttitudeError(rotation, subtract(omega, body.omega_body))


def _limited_fraction(ops: Ops, gains: Gains, half: Scalar, acceleration: Scalar, lag: Scalar) -> Scalar:
    """Return the fraction of an error [-] that the attitude loop may answer.

    Args:
        ops: of the arithmetic.
        gains: of which stiffness·half/damping is the commanded rate [rad/s].
        half: sin(θ/2) [-]; twice this is at most the error θ.
        acceleration: the angular deceleration [rad/s²] available.
        lag: [s] until it sets in.
    """
    a = _STOPPING_FRACTION * acceleration
    # (√(a² τ² + 4 a s) − a τ) / s, written without the difference
    slope = 4.0 * a / (a * lag + ops.sqrt(a * a * lag * lag + 4.0 * a * half) + TINY)
    return ops.minimum(1.0, slope * gains.damping / (gains.stiffness + TINY))
