"""The inner loop (paper, Section III): desired attitude and body rates, and the moment of eq. (2)."""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels import flatness
from aerobat.kernels.controller import Gains
from aerobat.kernels.ops import Axes, Matrix, Ops, Quaternion, Scalar, Vector
from aerobat.kernels.position_loop import Ahead, Outer, Target
from aerobat.kernels.rigid_body import Body
from aerobat.kernels.vectors import (
    add,
    add_scaled,
    axes,
    conjugate,
    cross,
    dot,
    length,
    multiply,
    scale,
    smallest_rotation,
    subtract,
    to_body,
    transform,
    within,
)

_LEAST_THRUST = 1e-3  # [m/s²] a specific thrust below it has no direction to follow


class Attitude(NamedTuple):
    """What the outer loop asks of the inner one."""

    specific_thrust: Vector  # [m/s²] world, along the desired b3
    q_world_body: Quaternion
    omega: Vector  # [rad/s] world


class Error(NamedTuple):
    """How far the body is from its desired attitude; body axes."""

    rotation: Vector  # sign(q_w)·q_vec of q* ⊗ q_des, half the angle where it is small
    omega: Vector  # [rad/s]


def desired(ops: Ops, outer: Outer, target: Target) -> Attitude:
    """The reference attitude, turned by the smallest rotation from its thrust axis to the commanded one.

    Rates: ω = b3 × f'/|f| with the jerk of reference and feedback in f', and the reference's spin about b3.
    Where the commanded specific thrust vanishes the reference attitude is kept.
    """
    f = add(target.specific_thrust, outer.acceleration)
    size = length(ops, f)
    determined = size > _LEAST_THRUST
    shrink = 1.0 / ops.maximum(size, _LEAST_THRUST)
    b1, _, nominal = axes(target.q_world_body)
    x, y, z = nominal
    b3 = (
        ops.select(determined, f[0] * shrink, x),
        ops.select(determined, f[1] * shrink, y),
        ops.select(determined, f[2] * shrink, z),
    )
    q = multiply(smallest_rotation(ops, nominal, b3, b1), target.q_world_body)
    swing = cross(b3, scale(shrink, add(target.jerk, outer.jerk)))
    return Attitude(f, q, add_scaled(swing, dot(nominal, target.omega), b3))


def error(ops: Ops, body: Body, body_axes: Axes, attitude: Attitude) -> Error:
    """How far the body is from its desired attitude and rates; the same for q and −q."""
    w, *vector = multiply(conjugate(body.q_world_body), attitude.q_world_body)
    omega = to_body(body_axes, attitude.omega)
    sign = ops.select(w < 0.0, -1.0, 1.0)
    return Error(scale(sign, tuple(vector)), subtract(omega, body.omega_body))


def accumulate(ops: Ops, gains: Gains, integral: Vector, error: Error, elapsed: Scalar) -> Vector:
    """The integral of the attitude error [rad·s], `elapsed` [s] later."""
    longer = add_scaled(integral, 2.0 * elapsed, error.rotation)
    return within(ops, longer, gains.max_attitude_integral)


def moment(gains: Gains, inertia: Matrix, error: Error, integral: Vector) -> Vector:
    """The feedback moment [N·m], body axes: eq. (2) as a PID, with gains per unit of inertia.

    M = J (2 ω_n² sign(q_w) q_vec + 2 ζ ω_n (ω_des − ω) + K_i ∫).
    """
    acceleration = add_scaled(scale(gains.stiffness, error.rotation), gains.damping, error.omega)
    return transform(inertia, add_scaled(acceleration, gains.attitude_integral, integral))


def reference_moment(inertia: Matrix, body_axes: Axes, ahead: Ahead) -> Vector:
    """The moment that the reference asks [N·m], J ω' + ω × Jω, with its rates in the body's own axes."""
    omega, omega_dot = to_body(body_axes, ahead.omega), to_body(body_axes, ahead.omega_dot)
    return flatness.moment(inertia, omega, omega_dot)
