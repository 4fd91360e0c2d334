"""The autopilot's controller as a component of the loop: towards a point, or towards a commanded attitude."""

from __future__ import annotations

from dataclasses import dataclass

from aerobat.kernels import control
from aerobat.kernels.control import ControllerModel, ControllerState, FeatureFlags
from aerobat.kernels.control_loops import (
    AttitudeCommand,
    PositionLoopState,
    ReferencePoint,
    attitude_command,
    step_position_loop,
    thrust_demand,
)
from aerobat.kernels.ops import Ops, Scalar, clip, magnitude, select_tree
from aerobat.kernels.rigid_body import Body
from aerobat.kernels.vectors import add, subtract
from aerobat.simulation.loop import Signals

_MIN_LIFT = 0.2  # [-] of gravity: towards a point it never thrusts less upwards, so that it stays upright
_MAX_SIDEWAYS = 1.0  # [-] of gravity: nor more than this to a side


@dataclass(frozen=True)
class AutopilotController:
    """The tracking controller of a vehicle that takes goals of two kinds.

    Its input is 1 where the reference's attitude, rates and thrust are commanded, 0 where its position is.
    """

    flags: FeatureFlags
    period: int = 1
    name: str = "controller"
    feedthrough: bool = True

    def init(
        self, ops: Ops, parameters: ControllerModel, inputs: Scalar, signals: Signals
    ) -> ControllerState:
        """See `Component.init`."""
        return control.init(ops, parameters, signals["observer"].body, signals["reference"])

    def step(
        self,
        ops: Ops,
        parameters: ControllerModel,
        state: ControllerState,
        by_attitude: Scalar,
        signals: Signals,
    ) -> ControllerState:
        """See `Component.step`."""
        body, reference, elapsed = signals["observer"].body, signals["reference"], signals["clock"].elapsed
        outer, towards = _towards_point(ops, parameters, state.outer, body, reference, elapsed)
        given = AttitudeCommand(reference.specific_thrust, reference.q_world_body, reference.omega)
        commanded = by_attitude > 0.5
        state = state._replace(outer=select_tree(ops, commanded, state.outer, outer))
        attitude = select_tree(ops, commanded, given, towards)
        return control.track_attitude(ops, self.flags, parameters, state, body, attitude, reference, elapsed)


def _towards_point(
    ops: Ops,
    model: ControllerModel,
    outer: PositionLoopState,
    body: Body,
    reference: ReferencePoint,
    elapsed: Scalar,
) -> tuple[PositionLoopState, AttitudeCommand]:
    """The outer loop a tick later, and the attitude that it asks for, upright whatever the error."""
    outer = step_position_loop(ops, model.gains, outer, body, reference, elapsed)
    demand = thrust_demand(model.airframe.mass_properties, model.environment, reference)
    gravity = model.environment.gravity
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
    limited = outer._replace(acceleration=subtract(upright, demand.value), jerk=subtract(rate, demand.rate))
    return outer, attitude_command(ops, limited, demand, reference)
