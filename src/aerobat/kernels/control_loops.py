"""The two loops of the tracking controller (paper, Section III): from tracking errors to a wrench."""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels import flatness
from aerobat.kernels.ops import Axes, Matrix, Ops, Quaternion, Scalar, Vector, select_tree
from aerobat.kernels.quaternions import axes, conjugate, multiply, smallest_rotation, to_body, to_world
from aerobat.kernels.rigid_body import Body, EnvironmentParameters, MassProperties
from aerobat.kernels.vectors import (
    ZERO,
    add,
    add_scaled,
    clamp_norm,
    cross,
    dot,
    low_passed,
    norm,
    scale,
    subtract,
    transform,
)

_MIN_THRUST = 1e-3  # [m/s²] a smaller specific thrust has no usable direction


class Gains(NamedTuple):
    """Gains of both loops, per unit of mass and inertia; see `aerobat.control.Controller`."""

    position: Scalar  # [1/s²]
    velocity: Scalar  # [1/s]
    integral: Scalar  # [1/s³]
    max_integral: Scalar  # [m·s]
    max_feedback: Scalar  # [m/s²]
    jerk_filter: Scalar  # [s]
    stiffness: Scalar  # [1/s²] of the attitude loop, on the vector part of a quaternion: 2 ω_n²
    damping: Scalar  # [1/s] of the attitude loop, 2 ζ ω_n
    attitude_integral: Scalar  # [1/s³]
    max_attitude_integral: Scalar  # [rad·s]
    lead_time_constant: Scalar  # [s]


class FeatureFlags(NamedTuple):
    """Features beyond the paper's law; see `aerobat.control.Controller`."""

    moment_feedforward: bool
    motor_lag_compensation: bool
    prioritize_tilt: bool


class Lookahead(NamedTuple):
    """Reference at the controller's next step, when the commands of this step have taken effect.

    Its rates are components along its own axes, given in world axes as if these axes stood as now, because
    the rotors turn with the body.
    """

    thrust_change: Scalar  # [m/s²] change of the collective thrust per mass until the next step
    omega: Vector  # [rad/s] world
    omega_dot: Vector  # [rad/s²] world


class ReferencePoint(NamedTuple):
    """Reference of the controller at one tick; world frame."""

    position: Vector  # [m]
    velocity: Vector  # [m/s]
    specific_thrust: Vector  # [m/s²] a + g·e3, without drag
    jerk: Vector  # [m/s³]
    q_world_body: Quaternion  # transported along the trajectory without spin, then yawed
    omega: Vector  # [rad/s]
    omega_dot: Vector  # [rad/s²]
    ahead: Lookahead


class PositionLoopState(NamedTuple):
    """State and output of the outer loop."""

    integral: Vector  # [m·s] of the position error
    acceleration: Vector  # [m/s²] feedback
    jerk: Vector  # [m/s³] its filtered derivative


def init_position_loop(ops: Ops, gains: Gains, body: Body, reference: ReferencePoint) -> PositionLoopState:
    """Return the state before the first tick: no integral and no feedback jerk."""
    return PositionLoopState(ZERO, _feedback_acceleration(ops, gains, ZERO, body, reference), ZERO)


def step_position_loop(
    ops: Ops, gains: Gains, state: PositionLoopState, body: Body, reference: ReferencePoint, elapsed: Scalar
) -> PositionLoopState:
    """Return the state of the outer loop `elapsed` [s] after the last tick."""
    error = subtract(reference.position, body.position)
    integral = clamp_norm(ops, add_scaled(state.integral, elapsed, error), gains.max_integral)
    acceleration = _feedback_acceleration(ops, gains, integral, body, reference)
    difference = scale(1.0 / elapsed, subtract(acceleration, state.acceleration))
    jerk = low_passed(state.jerk, difference, gains.jerk_filter, elapsed)
    return PositionLoopState(integral, acceleration, jerk)


def _feedback_acceleration(
    ops: Ops, gains: Gains, integral: Vector, body: Body, reference: ReferencePoint
) -> Vector:
    proportional = scale(gains.position, subtract(reference.position, body.position))
    damping = scale(gains.velocity, subtract(reference.velocity, body.velocity))
    feedback = add_scaled(add(proportional, damping), gains.integral, integral)
    return clamp_norm(ops, feedback, gains.max_feedback)


class ThrustDemand(NamedTuple):
    """Specific thrust that follows the reference against drag, and its derivative; world frame."""

    value: Vector  # [m/s²]
    rate: Vector  # [m/s³]


def thrust_demand(
    mass_properties: MassProperties, environment: EnvironmentParameters, reference: ReferencePoint
) -> ThrustDemand:
    """Return the reference's specific thrust plus compensation of the expected drag.

    With u = Rᵀ (v − w) and C = D/m, the demand is a + g e₃ + R C u. The rate of the demand is j + R (C u' + ω
    × C u), where u' = Rᵀ a − ω × u.
    """
    body_axes = axes(reference.q_world_body)
    x, y, z = reference.specific_thrust
    acceleration = to_body(body_axes, (x, y, z - environment.gravity))
    airspeed = to_body(body_axes, subtract(reference.velocity, environment.wind))
    omega = to_body(body_axes, reference.omega)
    drag = _over_mass(mass_properties, airspeed)
    change = _over_mass(mass_properties, subtract(acceleration, cross(omega, airspeed)))
    return ThrustDemand(
        add(reference.specific_thrust, to_world(body_axes, drag)),
        add(reference.jerk, to_world(body_axes, add(change, cross(omega, drag)))),
    )


def _over_mass(mass_properties: MassProperties, airspeed: Vector) -> Vector:
    """Return the negative drag per mass at an airspeed, body axes."""
    (dx, dy, dz), (u, v, w) = mass_properties.drag_body, airspeed
    return scale(1.0 / mass_properties.mass, (dx * u, dy * v, dz * w))


class AttitudeCommand(NamedTuple):
    """Reference of the inner loop."""

    specific_thrust: Vector  # [m/s²] world, along the desired b3
    q_world_body: Quaternion
    omega: Vector  # [rad/s] world


class AttitudeError(NamedTuple):
    """Attitude and rate error of the body; body axes."""

    rotation: Vector  # sign(q_w)·q_vec of q* ⊗ q_des, half the angle where it is small
    omega: Vector  # [rad/s]


def attitude_command(
    ops: Ops, outer: PositionLoopState, demand: ThrustDemand, reference: ReferencePoint
) -> AttitudeCommand:
    """Return the reference attitude, turned by the smallest rotation to the commanded thrust axis.

    The rates are ω = b3 × f'/|f|, with f' the sum of the demand's rate and the feedback jerk, plus the
    reference's spin about b3. Where the commanded specific thrust vanishes, the reference attitude is kept.

    Args:
        ops: the arithmetic of the engine.
        outer: the feedback of the outer loop.
        demand: the specific thrust of the reference.
        reference: the reference.
    """
    f = add(demand.value, outer.acceleration)
    size = norm(ops, f)
    determined = size > _MIN_THRUST
    shrink = 1.0 / ops.maximum(size, _MIN_THRUST)
    b1, _, nominal = axes(reference.q_world_body)
    b3 = select_tree(ops, determined, scale(shrink, f), nominal)
    q = multiply(smallest_rotation(ops, nominal, b3, b1), reference.q_world_body)
    swing = cross(b3, scale(shrink, add(demand.rate, outer.jerk)))
    return AttitudeCommand(f, q, add_scaled(swing, dot(nominal, reference.omega), b3))


def attitude_error(ops: Ops, body: Body, body_axes: Axes, attitude: AttitudeCommand) -> AttitudeError:
    """Return the attitude and rate error of the body; the same for q and −q."""
    w, x, y, z = multiply(conjugate(body.q_world_body), attitude.q_world_body)
    omega = to_body(body_axes, attitude.omega)
    sign = ops.select(w < 0.0, -1.0, 1.0)
    return AttitudeError(scale(sign, (x, y, z)), subtract(omega, body.omega_body))


def integrate_attitude_error(
    ops: Ops, gains: Gains, integral: Vector, error: AttitudeError, elapsed: Scalar
) -> Vector:
    """Return the integral of the attitude error [rad·s], `elapsed` [s] later."""
    longer = add_scaled(integral, 2.0 * elapsed, error.rotation)
    return clamp_norm(ops, longer, gains.max_attitude_integral)


def feedback_moment(gains: Gains, inertia: Matrix, error: AttitudeError, integral: Vector) -> Vector:
    """Return the feedback moment [N·m], body axes: eq. (2) as a PID, with gains per unit of inertia.

    M = J (2 ω_n² sign(q_w) q_vec + 2 ζ ω_n (ω_des − ω) + K_i ∫).
    """
    acceleration = add_scaled(scale(gains.stiffness, error.rotation), gains.damping, error.omega)
    return transform(inertia, add_scaled(acceleration, gains.attitude_integral, integral))


def reference_moment(inertia: Matrix, body_axes: Axes, rates: ReferencePoint | Lookahead) -> Vector:
    """Return the moment of the reference [N·m], J ω' + ω × Jω, with its rates in the body's own axes."""
    omega, omega_dot = to_body(body_axes, rates.omega), to_body(body_axes, rates.omega_dot)
    return flatness.moment(inertia, omega, omega_dot)


def moment_and_change(inertia: Matrix, body_axes: Axes, reference: ReferencePoint) -> tuple[Vector, Vector]:
    """Return the moment of the reference [N·m], and its change until the controller's next step."""
    now, then = (reference_moment(inertia, body_axes, each) for each in (reference, reference.ahead))
    return now, subtract(then, now)
