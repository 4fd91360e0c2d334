"""The outer loop (paper, Section III): position and velocity errors to a feedback acceleration."""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels.controller import Gains
from aerobat.kernels.ops import Ops, Quaternion, Scalar, Vector
from aerobat.kernels.rigid_body import Body, Inertial
from aerobat.kernels.vectors import ZERO, add, add_scaled, axes, scale, subtract, to_body, to_world, within


class Ahead(NamedTuple):
    """What the trajectory asks of the rotors by the time at which this tick's commands have taken effect."""

    thrust_change: Scalar  # [m/s²] |f| then, less |f| now
    omega: Vector  # [rad/s] world
    omega_dot: Vector  # [rad/s²] world


class Target(NamedTuple):
    """What the trajectory asks at one tick; world frame."""

    position: Vector  # [m]
    velocity: Vector  # [m/s]
    specific_thrust: Vector  # [m/s²] f = a + g·e3
    jerk: Vector  # [m/s³]
    q_world_body: Quaternion  # transported along the trajectory without spin, then yawed
    omega: Vector  # [rad/s]
    ahead: Ahead


class Outer(NamedTuple):
    """What the outer loop remembers; its answer is the acceleration and its derivative."""

    integral: Vector  # [m·s] of the position error
    acceleration: Vector  # [m/s²] feedback, and what makes up for the drag
    jerk: Vector  # [m/s³] its filtered derivative


def init(ops: Ops, gains: Gains, inertial: Inertial, body: Body, target: Target) -> Outer:
    """The memory before the first tick: no integral, and an answer that has stood for long."""
    return Outer(ZERO, _answer(ops, gains, inertial, ZERO, body, target), ZERO)


def step(
    ops: Ops, gains: Gains, inertial: Inertial, memory: Outer, body: Body, target: Target, elapsed: Scalar
) -> Outer:
    """The answer `elapsed` [s] after the last one."""
    error = subtract(target.position, body.position)
    integral = within(ops, add_scaled(memory.integral, elapsed, error), gains.max_integral)
    acceleration = _answer(ops, gains, inertial, integral, body, target)
    difference = scale(1.0 / elapsed, subtract(acceleration, memory.acceleration))
    share = elapsed / (gains.jerk_filter + elapsed)
    jerk = add_scaled(memory.jerk, share, subtract(difference, memory.jerk))
    return Outer(integral, acceleration, jerk)


def _answer(
    ops: Ops, gains: Gains, inertial: Inertial, integral: Vector, body: Body, target: Target
) -> Vector:
    proportional = scale(gains.position, subtract(target.position, body.position))
    damping = scale(gains.velocity, subtract(target.velocity, body.velocity))
    feedback = add_scaled(add(proportional, damping), gains.integral, integral)
    return subtract(within(ops, feedback, gains.max_feedback), _drag(inertial, target))


def _drag(inertial: Inertial, target: Target) -> Vector:
    """The acceleration by drag that is expected along the trajectory [m/s²], world."""
    body_axes = axes(target.q_world_body)
    u, v, w = to_body(body_axes, subtract(target.velocity, inertial.wind))
    dx, dy, dz = inertial.drag_body
    return scale(-1.0 / inertial.mass, to_world(body_axes, (dx * u, dy * v, dz * w)))
