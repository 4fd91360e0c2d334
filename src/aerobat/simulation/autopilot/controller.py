"""The autopilot's controller as a component of the loop: along a path, towards a point, or in an attitude."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from aerobat.kernels import control
from aerobat.kernels.control import ControllerModel, ControllerState, FeatureFlags
from aerobat.kernels.control_loops import (
    AttitudeCommand,
    PositionLoopState,
    ThrustDemand,
    attitude_command,
    step_position_loop,
    thrust_demand,
)
from aerobat.kernels.ops import Ops, Scalar, clip, magnitude, select_tree
from aerobat.kernels.vectors import add, subtract
from aerobat.simulation.loop import Signals

_MIN_LIFT = 0.2  # [-] of gravity: towards a point it never thrusts less upwards, so that it stays upright
_MAX_SIDEWAYS = 1.0  # [-] of gravity: nor more than this to a side


class Guidance(NamedTuple):
    """Input of the controller: what of a reference is commanded; each is 1 where it holds, else 0."""

    by_attitude: Scalar  # its attitude, rates and thrust; else its position
    upright: Scalar  # towards a position, no further tilted than an autopilot would


@dataclass(frozen=True)
class AutopilotController:
    """The tracking controller of a vehicle that takes attitudes, points, and points of a path."""

    flags: FeatureFlags
    period: int = 1
    name: str = "controller"
    feedthrough: bool = True

    def init(
        self, ops: Ops, parameters: ControllerModel, inputs: Guidance, signals: Signals
    ) -> ControllerState:
        """See `Component.init`."""
        return control.init(ops, parameters, signals["observer"].body, signals["reference"])

    def step(
        self,
        ops: Ops,
        parameters: ControllerModel,
        state: ControllerState,
        inputs: Guidance,
        signals: Signals,
    ) -> ControllerState:
        """See `Component.step`."""
        body, reference, elapsed = signals["observer"].body, signals["reference"], signals["clock"].elapsed
        outer = step_position_loop(ops, parameters.gains, state.outer, body, reference, elapsed)
        demand = thrust_demand(parameters.airframe.mass_properties, parameters.environment, reference)
        limited = _upright(ops, parameters.environment.gravity, outer, demand)
        sought = select_tree(ops, inputs.upright > 0.5, limited, outer)
        towards = attitude_command(ops, sought, demand, reference)
        given = AttitudeCommand(reference.specific_thrust, reference.q_world_body, reference.omega)
        commanded = inputs.by_attitude > 0.5
        state = state._replace(outer=select_tree(ops, commanded, state.outer, outer))
        attitude = select_tree(ops, commanded, given, towards)
        return control.track_attitude(ops, self.flags, parameters, state, body, attitude, reference, elapsed)


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
