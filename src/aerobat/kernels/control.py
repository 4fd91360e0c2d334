"""The tracking controller (paper, Section III and Fig. 4): outer loop, inner loop, rotor commands."""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

from aerobat.kernels import motors
from aerobat.kernels.allocation import Mixer, desaturate, mix, within_limits
from aerobat.kernels.control_loops import (
    AttitudeCommand,
    AttitudeError,
    FeatureFlags,
    Gains,
    PositionLoopState,
    ReferencePoint,
    attitude_command,
    attitude_error,
    feedback_moment,
    init_position_loop,
    integrate_attitude_error,
    moment_and_change,
    reference_moment,
    step_position_loop,
    thrust_demand,
)
from aerobat.kernels.motors import Airframe
from aerobat.kernels.ops import Axes, Ops, PerRotor, Scalar, Vector, select_tree
from aerobat.kernels.quaternions import axes
from aerobat.kernels.rigid_body import Body, EnvironmentParameters, RotorWrench
from aerobat.kernels.vectors import ZERO, add, dot, norm

# [-] smallest thrust, as a fraction of the commanded specific thrust, where the vehicle points away from it
_MIN_THRUST_FRACTION = 0.3


class ControllerModel(NamedTuple):
    """The nominal vehicle that the controller assumes, and the gains for it."""

    airframe: Airframe
    environment: EnvironmentParameters
    mixer: Mixer
    gains: Gains


class Commands(NamedTuple):
    """Commands of one tick."""

    thrusts: PerRotor  # [N] within limits
    saturated: Scalar  # true where the limits changed the thrusts


class AttitudePursuit(NamedTuple):
    """Input of the inner loop."""

    error: AttitudeError
    thrust: Scalar  # [N] collective


class ControllerState(NamedTuple):
    """State of the controller from tick to tick, including its commands."""

    outer: PositionLoopState
    attitude_integral: Vector  # [rad·s]
    thrusts: PerRotor  # [N] rotor thrusts predicted by the nominal model
    commands: Commands  # the last commands


def init(ops: Ops, model: ControllerModel, body: Body, reference: ReferencePoint) -> ControllerState:
    """Return the state before the first tick, with the rotor thrusts that the reference requires there."""
    mass_properties, rotors = model.airframe
    moment = reference_moment(mass_properties.inertia, axes(body.q_world_body), reference)
    demand = thrust_demand(mass_properties, model.environment, reference)
    feedforward = RotorWrench(mass_properties.mass * norm(ops, demand.value), moment)
    thrusts = motors.clamp(ops, rotors, mix(model.mixer, feedforward))
    outer = init_position_loop(ops, model.gains, body, reference)
    return ControllerState(outer, ZERO, thrusts, Commands(thrusts, False))


def step(
    ops: Ops,
    flags: FeatureFlags,
    model: ControllerModel,
    state: ControllerState,
    body: Body,
    reference: ReferencePoint,
    elapsed: Scalar,
) -> ControllerState:
    """Return the state, including new commands, `elapsed` [s] after the last tick."""
    outer = step_position_loop(ops, model.gains, state.outer, body, reference, elapsed)
    demand = thrust_demand(model.airframe.mass_properties, model.environment, reference)
    attitude = attitude_command(ops, outer, demand, reference)
    body_axes = axes(body.q_world_body)
    pursuit = AttitudePursuit(
        attitude_error(ops, body, body_axes, attitude),
        collective(ops, model.airframe.mass_properties.mass, body_axes[2], attitude),
    )
    state = state._replace(outer=outer)
    return track_attitude(ops, flags, model, state, body_axes, pursuit, reference, elapsed)


def track_attitude(
    ops: Ops,
    flags: FeatureFlags,
    model: ControllerModel,
    state: ControllerState,
    body_axes: Axes,
    pursuit: AttitudePursuit,
    reference: ReferencePoint,
    elapsed: Scalar,
) -> ControllerState:
    """Return the state, including new commands, of the inner loop, which turns the body to an attitude.

    Args:
        ops: the arithmetic of the engine.
        flags: features beyond the paper's law.
        model: the nominal vehicle.
        state: state after the last tick, with an outer loop that is already updated.
        body_axes: present axes of the body.
        pursuit: the attitude error, and the collective thrust.
        reference: the reference; its rates and their change give the feed-forward moment.
        elapsed: time since the last tick [s].
    """
    mass_properties, rotors = model.airframe
    error = pursuit.error
    # while rotors saturate, the attitude error does not indicate a lasting moment
    integration_time = ops.select(state.commands.saturated, 0.0, elapsed)
    integral = integrate_attitude_error(ops, model.gains, state.attitude_integral, error, integration_time)
    moment, change = feedback_moment(model.gains, mass_properties.inertia, error, integral), ZERO
    if flags.moment_feedforward:
        now, change = moment_and_change(mass_properties.inertia, body_axes, reference)
        moment = add(moment, now)
    load = RotorWrench(pursuit.thrust, moment)
    ahead = RotorWrench(mass_properties.mass * reference.ahead.thrust_change, change)
    decay_factors = motors.decay_factors(ops, rotors, elapsed)
    thrusts = motors.first_order_response(state.thrusts, state.commands.thrusts, decay_factors)
    commands = rotor_commands(ops, flags, model, (load, ahead), thrusts, decay_factors, elapsed)
    return ControllerState(state.outer, integral, thrusts, commands)


@runtime_checkable
class Controlling(Protocol):
    """The part of any controller's state that other code uses."""

    @property
    def thrusts(self) -> PerRotor:
        """The rotor thrusts [N] predicted by the nominal model."""

    @property
    def commands(self) -> Commands:
        """The last commands."""


def predicted(
    ops: Ops, model: ControllerModel, state: Controlling, body: Body, elapsed: Scalar, delay: Scalar
) -> Body:
    """Return the predicted body when new commands take effect, `delay` [s] from now (Smith predictor).

    Until then the rotors of the nominal model follow the last commands, which took effect `elapsed` − `delay`
    ago.

    Args:
        ops: the arithmetic of the engine.
        model: the nominal vehicle.
        state: state after the last step.
        body: present state of the body.
        elapsed: time since the last step [s]; the last step of a path may be shorter than the delay.
        delay: delay of the commands [s].
    """
    rotors = model.airframe.rotors
    decay = motors.decay_factors(ops, rotors, ops.maximum(elapsed - delay, 0.0))
    now = motors.first_order_response(state.thrusts, state.commands.thrusts, decay)
    motion = motors.VehicleState(body, now)
    return motors.advance(ops, model.airframe, model.environment, motion, state.commands.thrusts, delay).body


def collective(ops: Ops, mass: Scalar, b3: Vector, attitude: AttitudeCommand) -> Scalar:
    """Return the collective thrust [N]: the commanded specific thrust projected on b3, times the mass.

    A vehicle that points away keeps a fraction of |f|, because without thrust it could not turn back.
    """
    f = attitude.specific_thrust
    return mass * ops.maximum(dot(f, b3), _MIN_THRUST_FRACTION * norm(ops, f))


def rotor_commands(
    ops: Ops,
    flags: FeatureFlags,
    model: ControllerModel,
    loads: tuple[RotorWrench, RotorWrench],
    thrusts: PerRotor,
    decay_factors: PerRotor,
    period: Scalar,
) -> Commands:
    """Return commands for a load, and for its change by the reference until the next tick.

    The load is first brought within the limits. The lead is then clipped for each rotor: a lead beyond the
    limits only comes from moments, which every rotor should build up as fast as possible.

    Args:
        ops: the arithmetic of the engine.
        flags: features beyond the paper's law.
        model: the nominal vehicle.
        loads: the load, and its change.
        thrusts: rotor thrusts [N] by the nominal model.
        decay_factors: decay factors of the rotors over a period.
        period: time until the next tick [s].
    """
    rotors, (load, ahead) = model.airframe.rotors, loads
    desired = mix(model.mixer, load)
    feasible = within_limits(rotors, desired)
    if flags.prioritize_tilt:
        desaturated = desaturate(ops, rotors, model.mixer, load)
        desired = select_tree(ops, feasible, desired, desaturated)
    if flags.motor_lag_compensation:
        fraction = 1.0 - ops.exp(-period / model.gains.lead_time_constant)
        desired = _lead_compensated(thrusts, desired, mix(model.mixer, ahead), decay_factors, fraction)
    changed = ops.select(feasible & within_limits(rotors, desired), False, True)
    return Commands(motors.clamp(ops, rotors, desired), changed)


def _lead_compensated(
    thrusts: PerRotor, desired: PerRotor, changes: PerRotor, decay_factors: PerRotor, fraction: Scalar
) -> PerRotor:
    """Return commands [N] that move the rotors in one period by a `fraction` of `desired` − `thrusts`.

    The reference's `changes` are added. On the reference the commands are u = f + τ f'. Deviations pass a
    low-pass filter of time constant T, with fraction = 1 − e^(−period/T). As the commands are relative to the
    predicted thrusts, they continue after a saturation until the rotors reach `desired`.
    """
    return tuple(
        f + ((w - f) * fraction + change) / (1.0 - decay)
        for f, w, change, decay in zip(thrusts, desired, changes, decay_factors, strict=True)
    )
