"""The autopilot's controller as a component of the loop: it tracks a path, a point or an attitude."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from aerobat.kernels import control
from aerobat.kernels.control import AttitudePursuit, ControllerModel, ControllerState
from aerobat.kernels.control_loops import (
    AttitudeCommand,
    FeatureFlags,
    Gains,
    PositionLoopState,
    ThrustDemand,
    attitude_command,
    step_position_loop,
    thrust_demand,
)
from aerobat.kernels.ops import TINY, Ops, Scalar, Vector, clip, magnitude, select_tree
from aerobat.kernels.quaternions import axes
from aerobat.kernels.vectors import add, dot, norm, subtract
from aerobat.simulation.autopilot.attitude_law import Authority, limited_attitude_error
from aerobat.simulation.loop import Component, Signals

_MIN_LIFT = 0.2  # [-] of gravity: least upward thrust on the way to a point; keeps the vehicle upright
_MAX_HORIZONTAL = 1.0  # [-] of gravity: most horizontal thrust along x and along y on the way to a point


class AutopilotModel(NamedTuple):
    """The nominal vehicle, and the limits that its rotors set where errors are large."""

    tracking: ControllerModel
    authority: Authority
    upright: Gains  # of the position loop towards points, slow enough for the time that tilting takes


class Guidance(NamedTuple):
    """Input of the controller: the parts of the reference that are commanded, each flag 1 or 0."""

    by_attitude: Scalar  # 1: attitude, body rates and thrust are commanded; 0: position is
    upright: Scalar  # 1: tilt is limited on the way to a position


@dataclass(frozen=True)
class AutopilotController(Component):
    """The tracking controller of a vehicle that accepts attitudes, points, and points of a path."""

    flags: FeatureFlags

    def init(self, parameters: AutopilotModel, signals: Signals) -> ControllerState:
        """See `Component.init`."""
        return control.init(signals.ops, parameters.tracking, signals.observer.body, signals.reference)

    def step(self, parameters: AutopilotModel, state: ControllerState, signals: Signals) -> ControllerState:
        """See `Component.step`."""
        ops, elapsed = signals.ops, signals.clock.elapsed
        body, reference = signals.observer.body, signals.reference
        model, authority, slower = parameters
        guidance: Guidance = signals.inputs
        commanded, upright = guidance.by_attitude > 0.5, guidance.upright > 0.5
        gains = select_tree(ops, upright, slower, model.gains)
        outer = step_position_loop(ops, gains, state.outer, body, reference, elapsed)
        demand = thrust_demand(model.airframe.mass_properties, model.environment, reference)
        sought = select_tree(ops, upright, _upright(ops, model.environment.gravity, outer, demand), outer)
        towards = attitude_command(ops, sought, demand, reference)
        setpoint = AttitudeCommand(reference.specific_thrust, reference.q_world_body, reference.omega)
        state = state._replace(outer=select_tree(ops, commanded, state.outer, outer))
        attitude = select_tree(ops, commanded, setpoint, towards)
        body_axes = axes(body.q_world_body)
        thrust = control.collective(ops, model.airframe.mass_properties.mass, body_axes[2], attitude)
        turning = ops.maximum(thrust, _turning_thrust(ops, model, body_axes[2], towards))
        pursuit = AttitudePursuit(
            limited_attitude_error(ops, model.gains, authority, body, body_axes, attitude),
            ops.select(commanded, thrust, ops.select(upright, turning, thrust)),
        )
        return control.track_attitude(ops, self.flags, model, state, body_axes, pursuit, reference, elapsed)


def _turning_thrust(ops: Ops, model: ControllerModel, b3: Vector, attitude: AttitudeCommand) -> Scalar:
    """Return the collective thrust [N] that lets rotors turn the body: sin(θ/2) of the weight.

    Rotors with little thrust cannot take much from one side to make a moment. θ is the angle to the desired
    direction of thrust; a smaller angle needs less thrust.
    """
    f = attitude.specific_thrust
    cosine = dot(f, b3) / (norm(ops, f) + TINY)
    weight = model.airframe.mass_properties.mass * model.environment.gravity
    return weight * ops.sqrt(ops.maximum(0.5 - 0.5 * cosine, 0.0))


def _upright(ops: Ops, gravity: Scalar, outer: PositionLoopState, demand: ThrustDemand) -> PositionLoopState:
    """Return the position loop's answer, limited so that the vehicle stays upright whatever the error.

    Args:
        ops: of the arithmetic.
        gravity: [m/s²].
        outer: the answer of the position loop.
        demand: the thrust required by the reference.
    """
    sideways, lift = _MAX_HORIZONTAL * gravity, _MIN_LIFT * gravity
    x, y, z = add(demand.value, outer.acceleration)
    upright = clip(ops, x, -sideways, sideways), clip(ops, y, -sideways, sideways), ops.maximum(z, lift)
    # a saturated component has no rate
    jx, jy, jz = add(demand.rate, outer.jerk)
    rate = (
        ops.select(magnitude(ops, x) < sideways, jx, 0.0),
        ops.select(magnitude(ops, y) < sideways, jy, 0.0),
        ops.select(z > lift, jz, 0.0),
    )
    return outer._replace(acceleration=subtract(upright, demand.value), jerk=subtract(rate, demand.rate))
