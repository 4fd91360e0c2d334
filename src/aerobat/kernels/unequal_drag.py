"""Differential flatness of a body whose drag differs between body x and body y, in scalar components.

Let v be the airspeed, c the drag per mass in body axes and h = a + g e3. The rotors' force is along b3 if

    b1·α = 0,   b2·β = 0,     α = h + c_x v,   β = h + c_y v.

These equations leave one angle open. Without a yaw rate the body does not spin about b3: b1' = −ω_y b3, b2' =
ω_x b3, and in body axes

    ω_x = −β'_y/β_z,   ω_y = α'_x/α_z,   ω_z = 0,   T = m γ_z,     γ = h + c_z v.

With a yaw rate ω_z = s, s α_y is added to α'_x, and s β_x is subtracted from β'_y.

Vectors below are in body axes. Their derivatives α, α', α'', … are world derivatives in body components.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from aerobat.kernels import flatness
from aerobat.kernels.ops import Axes, Matrix, Scalar, Vector
from aerobat.kernels.quaternions import to_body
from aerobat.kernels.vectors import add, add_scaled, cross, dot, scale


def nearest_axes(sqrt: Callable[[Scalar], Scalar], alpha: Vector, beta: Vector) -> Axes:
    """Return b1, b2, b3 with b1·α = b2·β = 0 and b1 normal to y, in axes near the body's."""
    x, _, z = alpha
    shrink = 1.0 / sqrt(x * x + z * z)
    b1 = (z * shrink, 0.0 * z, -x * shrink)
    b2 = cross(beta, b1)
    b2 = scale(1.0 / sqrt(dot(b2, b2)), b2)
    return b1, b2, cross(b1, b2)


def body_rates(
    inverse: tuple[Scalar, Scalar],
    alpha: Sequence[Vector],
    beta: Sequence[Vector],
    yaw: Sequence[Scalar] | None = None,
) -> tuple[Vector, Vector]:
    """Return ω [rad/s] and ω' [rad/s²].

    Args:
        inverse: 1/α_z and 1/β_z.
        alpha: α, α', α''.
        beta: β, β', β''.
        yaw: ω_z and ω_z'; None for no spin.
    """
    per_alpha, per_beta = inverse
    wx, wy = -1.0 * beta[1][1] * per_beta, alpha[1][0] * per_alpha
    if yaw is not None:
        wx, wy = wx + yaw[0] * beta[0][0] * per_beta, wy + yaw[0] * alpha[0][1] * per_alpha
    both = wx * wy
    dwx = -1.0 * (beta[2][1] + 2.0 * wx * beta[1][2] + both * beta[0][0]) * per_beta
    dwy = (alpha[2][0] - 2.0 * wy * alpha[1][2] + both * alpha[0][1]) * per_alpha
    if yaw is None:
        return (wx, wy, 0.0), (dwx, dwy, 0.0)
    spin, change = yaw
    dwx = dwx + (2.0 * spin * beta[1][0] - spin * wy * beta[0][2] + change * beta[0][0]) * per_beta
    dwy = dwy + (2.0 * spin * alpha[1][1] + spin * wx * alpha[0][2] + change * alpha[0][1]) * per_alpha
    return (wx, wy, spin), (dwx, dwy, change)


def angular_jerk(
    inverse: tuple[Scalar, Scalar],
    alpha: Sequence[Vector],
    beta: Sequence[Vector],
    omega: Vector,
    omega_dot: Vector,
    change: Scalar | None = None,
) -> Vector:
    """Return ω'' [rad/s³].

    Args:
        inverse: 1/α_z and 1/β_z.
        alpha: α, α', α'', α'''.
        beta: β, β', β'', β'''.
        omega: ω.
        omega_dot: ω'.
        change: ω_z''; None for no spin.
    """
    per_alpha, per_beta = inverse
    (wx, wy, s), (dwx, dwy, ds) = omega, omega_dot
    both, both_rate = wx * wy, dwx * wy + wx * dwy
    rising_beta = beta[1][2] + wy * beta[0][0]  # β_z'
    rising_alpha = alpha[1][2] - wx * alpha[0][1]  # α_z'
    x = beta[3][1] + wx * beta[2][2] + 2.0 * dwx * beta[1][2]
    x = x + 2.0 * wx * (beta[2][2] - wx * beta[1][1] + wy * beta[1][0])
    x = x + both_rate * beta[0][0] + both * (beta[1][0] - wy * beta[0][2]) + dwx * rising_beta
    y = alpha[3][0] - wy * alpha[2][2] - 2.0 * dwy * alpha[1][2]
    y = y - 2.0 * wy * (alpha[2][2] - wx * alpha[1][1] + wy * alpha[1][0])
    y = y + both_rate * alpha[0][1] + both * (alpha[1][1] + wx * alpha[0][2]) - dwy * rising_alpha
    if change is None:
        return -1.0 * x * per_beta, y * per_alpha, 0.0
    x = x - 3.0 * (s * beta[2][0] + ds * beta[1][0]) + 2.0 * s * (wy * beta[1][2] - s * beta[1][1])
    x = x + (2.0 * ds * wy + s * dwy) * beta[0][2] + s * wy * rising_beta - change * beta[0][0]
    y = y + 3.0 * (s * alpha[2][1] + ds * alpha[1][1]) + 2.0 * s * (wx * alpha[1][2] - s * alpha[1][0])
    y = y + (2.0 * ds * wx + s * dwx) * alpha[0][2] + s * wx * rising_alpha + change * alpha[0][1]
    return -1.0 * x * per_beta, y * per_alpha, change


def collective(mass: Scalar, gamma: Sequence[Vector], omega: Vector) -> tuple[Scalar, Scalar]:
    """Return the collective thrust [N] and its derivative [N/s]; `gamma` is γ, γ'."""
    now, change = gamma
    return mass * now[2], mass * (change[2] - omega[0] * now[1] + omega[1] * now[0])


def frame_spin(
    thrust: tuple[Scalar, Vector], alpha: tuple[Vector, Vector], body: Axes, yaw_rate: Scalar
) -> Scalar:
    """Return the rate [rad/s] at which the given axes turn about the mean-drag thrust, relative to a body.

    The axes are x, y and z, with z along the mean-drag specific thrust, and b1 stays normal to y.

    Args:
        thrust: Norm of the mean-drag specific thrust, and its derivative.
        alpha: α and α'.
        body: b1, b2 and b3 from `nearest_axes`.
        yaw_rate: ω_z [rad/s].
    """
    norm, change = thrust
    b1, b2, b3 = body
    pitch = (dot(b1, alpha[1]) + yaw_rate * dot(b2, alpha[0])) / dot(b3, alpha[0])
    return -1.0 * (change[1] / norm * b1[2] + pitch * b3[1] - yaw_rate * b2[1]) / b1[0]


class BodyMotion(NamedTuple):
    """A motion at one instant, in axes near the body's."""

    weight: Vector  # [m/s²] g e3
    airspeed: Vector  # [m/s]
    acceleration: Vector  # [m/s²]
    jerk: Vector  # [m/s³]
    snap: Vector  # [m/s⁴]
    crackle: Vector  # [m/s⁵]


class Demand(NamedTuple):
    """The requirements of a motion on a vehicle."""

    wrench: tuple[Scalar, Scalar, Scalar, Scalar]  # collective thrust [N] and moment [N·m], body axes
    rate: tuple[Scalar, Scalar, Scalar, Scalar]  # their derivatives
    specific_thrust: Scalar  # [m/s²] along b3, including the compensation of lateral drag
    omega: Vector  # [rad/s] body axes
    b3: Vector  # in the axes of the motion


def demand(
    sqrt: Callable[[Scalar], Scalar], mass: Scalar, inertia: Matrix, drag: Vector, motion: BodyMotion
) -> Demand:
    """Return the requirements of a motion; exact where the body has the axes of the motion.

    For other axes near the body's, the body's axes are `nearest_axes`. They are exact to first order except
    for the angle about b3.

    Args:
        sqrt: The square root of the arithmetic.
        mass: Of the vehicle [kg].
        inertia: [kg·m²].
        drag: Over the mass, along body x, y and z [1/s].
        motion: The motion.
    """
    lifted = add(motion.acceleration, motion.weight), motion.jerk, motion.snap, motion.crackle
    dragged = motion.airspeed, motion.acceleration, motion.jerk, motion.snap
    alpha, beta, gamma = (
        [add_scaled(x, coefficient, below) for x, below in zip(lifted, dragged, strict=True)]
        for coefficient in drag
    )
    body = nearest_axes(sqrt, alpha[0], beta[0])
    alpha, beta, gamma = ([to_body(body, vector) for vector in each] for each in (alpha, beta, gamma))
    inverse = 1.0 / alpha[0][2], 1.0 / beta[0][2]
    omega, omega_dot = body_rates(inverse, alpha, beta)
    jerk = angular_jerk(inverse, alpha, beta, omega, omega_dot)
    thrust, thrust_rate = collective(mass, gamma[:2], omega)
    moment, moment_rate = flatness.moment_and_rate(inertia, omega, omega_dot, jerk)
    along = 0.5 * (alpha[0][2] + beta[0][2])
    return Demand((thrust, *moment), (thrust_rate, *moment_rate), along, omega, body[2])
