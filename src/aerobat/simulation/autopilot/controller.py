"""The autopilot's controller as a component of the loop: along a path, towards a point, or in an attitude."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from aerobat.kernels import control
from aerobat.kernels.control import AttitudePursuit, ControllerModel, ControllerState, FeatureFlags
from aerobat.kernels.control_loops import (
    AttitudeCommand,
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
from aerobat.simulation.autopilot.attitude_law import Authority, slope_limited_error
from aerobat.simulation.loop import Component, Signals

_MIN_LIFT = 0.2  # [-] of gravity: towards a point it never thrusts less upwards, so that it stays upright
_MAX_SIDEWAYS = 1.0  # [-] of gravity: nor more than this to a side


class AutopilotModel(NamedTuple):
    """The nominal vehicle, and what its rotors allow where errors are large."""

    tracking: ControllerModel
    authority: Authority
    upright: Gains  # of the position loop towards points, slow enough for tilts that take their time


class Guidance(NamedTuple):
    """Input of the controller: what of a reference is commanded; each is 1 where it holds, else 0."""

    by_attitude: Scalar  # its attitude, rates and thrust; else its position
    upright: Scalar  # towards a position, no further tilted than an autopilot would


@dataclass(frozen=True)
class AutopilotController(Component):
    """The tracking controller of a vehicle that takes attitudes, points, and points of a path."""

    flags: FeatureFlags

    def init(
        self, ops: Ops, parameters: AutopilotModel, inputs: Guidance, signals: Signals
    ) -> ControllerState:
        """See `Component.init`."""
        return control.init(ops, parameters.tracking, signals.observer.body, signals.reference)

    def step(
        self,
        ops: Ops,
        parameters: AutopilotModel,
        state: ControllerState,
        inputs: Guidance,
        signals: Signals,
    ) -> ControllerState:
        """See `Component.step`."""
        body, reference, elapsed = signals.observer.body, signals.reference, signals.clock.elapsed
        model, authority, slower = parameters
        commanded, upright = inputs.by_attitude > 0.5, inputs.upright > 0.5
        gains = select_tree(ops, upright, slower, model.gains)
        outer = step_position_loop(ops, gains, state.outer, body, reference, elapsed)
        demand = thrust_demand(model.airframe.mass_properties, model.environment, reference)
        sought = select_tree(ops, upright, _upright(ops, model.environment.gravity, outer, demand), outer)
        towards = attitude_command(ops, sought, demand, reference)
        given = AttitudeCommand(reference.specific_thrust, reference.q_world_body, reference.omega)
        state = state._replace(outer=select_tree(ops, commanded, state.outer, outer))
        attitude = select_tree(ops, commanded, given, towards)
        body_axes = axes(body.q_world_body)
        thrust = control.collective(ops, model.airframe.mass_properties.mass, body_axes[2], attitude)
        turning = ops.maximum(thrust, _turning_thrust(ops, model, body_axes[2], towards))
        pursuit = AttitudePursuit(
            slope_limited_error(ops, model.gains, authority, body, body_axes, attitude),
            ops.select(commanded, thrust, ops.select(upright, turning, thrust)),
        )
        return control.track_attitude(ops, self.flags, model, state, body_axes, pursuit, reference, elapsed)


def _turning_thrust(ops: Ops, model: ControllerModel, b3: Vector, attitude: AttitudeCommand) -> Scalar:
    """The collective thrust [N] that keeps rotors able to turn the body: sin(θ/2) of its weight.

    The less they give, the less they have to take from one side; the smaller the angle θ to the desired
    direction, the less is needed.
    """
    f = attitude.specific_thrust
    cosine = dot(f, b3) / (norm(ops, f) + TINY)
    weight = model.airframe.mass_properties.mass * model.environment.gravity
    return weight * ops.sqrt(ops.maximum(0.5 - 0.5 * cosine, 0.0))


def _upright(ops: Ops, gravity: Scalar, outer: PositionLoopState, demand: ThrustDemand) -> PositionLoopState:
    """The outer loop's answer, taken back to where the vehicle stays upright whatever the error.

    Args:
        ops: of the arithmetic.
        gravity: [m/s²].
        outer: the answer.
        demand: the thrust that the reference asks for.
    """
    sideways, lift = _MAX_SIDEWAYS * gravity, _MIN_LIFT * gravity
    x, y, z = add(demand.value, outer.acceleration)
    upright = clip(ops, x, -sideways, sideways), clip(ops, y, -sideways, sideways), ops.maximum(z, lift)
    # what is held does not change either
    jx, jy, jz = add(demand.rate, outer.jerk)
    rate = (
        ops.select(magnitude(ops, x) < sideways, jx, 0.0),
        ops.select(magnitude(ops, y) < sideways, jy, 0.0),
        ops.select(z > lift, jz, 0.0),
    )
    return outer._replace(acceleration=subtract(upright, demand.value), jerk=subtract(rate, demand.rate))
