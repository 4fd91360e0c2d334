"""The loop's components that every flight has: what the controller sees, the controller, the plant."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

from aerobat.kernels import control, motors, rate_loop
from aerobat.kernels.battery import BatteryState
from aerobat.kernels.control import Commands, ControllerModel, ControllerState, Controlling, FeatureFlags
from aerobat.kernels.control_loops import ReferencePoint
from aerobat.kernels.imu import ImuState
from aerobat.kernels.motors import Airframe, VehicleState
from aerobat.kernels.ops import Ops, PerRotor, Scalar, Vector, select_tree
from aerobat.kernels.quaternions import axes, to_world
from aerobat.kernels.rate_loop import RateLoopModel, RateLoopState, RateSetpoint
from aerobat.kernels.rigid_body import Body, EnvironmentParameters
from aerobat.kernels.vectors import subtract
from aerobat.kernels.wind import WindState
from aerobat.simulation.loop import Component, Estimate, Signals

MAX_STEP = 0.002  # [s] of RK4: enough for 1e-6 m in the fastest flips


def rigid_body_steps(duration: float) -> int:
    """The number of steps of RK4 in which a rigid body is advanced by a duration [s]."""
    return max(1, math.ceil(duration / MAX_STEP - 1e-9))


@dataclass(frozen=True)
class StateObserver(Component):
    """The true state, as if it were known."""

    def init(self, ops: Ops, parameters: tuple[()], inputs: tuple[()], signals: Signals) -> Estimate:
        """See `Component.init`."""
        return Estimate(signals.start)

    def step(
        self, ops: Ops, parameters: tuple[()], state: Estimate, inputs: tuple[()], signals: Signals
    ) -> Estimate:
        """See `Component.step`."""
        return Estimate(signals.plant.body)


class ControllerParameters(NamedTuple):
    """A controller, and the delay of its commands."""

    model: ControllerModel
    delay: Scalar | tuple[()]  # [s] from the state to the commands made of it; () for at once


@dataclass(frozen=True)
class TrackingController(Component):
    """The tracking controller, which takes the body's state from the observer.

    Its reference is an input of its own where its commands come late, else that of the tick.
    """

    flags: FeatureFlags

    def init(
        self,
        ops: Ops,
        parameters: ControllerParameters,
        inputs: ReferencePoint | tuple[()],
        signals: Signals,
    ) -> ControllerState:
        """See `Component.init`."""
        reference = inputs or signals.reference
        return control.init(ops, parameters.model, signals.observer.body, reference)

    def step(
        self,
        ops: Ops,
        parameters: ControllerParameters,
        state: ControllerState,
        inputs: ReferencePoint | tuple[()],
        signals: Signals,
    ) -> ControllerState:
        """See `Component.step`."""
        body, reference = controller_inputs(ops, parameters, state, inputs, signals)
        return control.step(ops, self.flags, parameters.model, state, body, reference, signals.clock.elapsed)


def controller_inputs(
    ops: Ops,
    parameters: ControllerParameters,
    state: Controlling,
    inputs: ReferencePoint | tuple[()],
    signals: Signals,
    takes_forces: bool = True,
    takes_moments: bool = True,
) -> tuple[Body, ReferencePoint]:
    """Return the state when the commands take effect, and the reference that counters the disturbance.

    Args:
        ops: The operations of an engine.
        parameters: A controller and its delay.
        state: The controller's, of which the thrusts and the last commands count.
        inputs: A reference of its own, where its commands come late.
        signals: Of the loop.
        takes_forces: Whether the reference answers the disturbing force that the observer knows.
        takes_moments: The same of the moment.
    """
    body, reference = signals.observer.body, inputs or signals.reference
    disturbance = signals.find(Disturbance)
    if takes_forces and disturbance is not None:
        reference = _answering(reference, body, disturbance, takes_moments)
    if not isinstance(parameters.delay, tuple):
        elapsed = signals.clock.elapsed
        body = control.predicted(ops, parameters.model, state, body, elapsed, parameters.delay)
    return body, reference


class Disturbance(NamedTuple):
    """The disturbance that an IMU feels beyond the model, in body axes.

    Most of a disturbance, such as the rotors' mismatch, turns with the body.
    """

    force: Vector  # [m/s²] over mass
    angular_acceleration: Vector  # [rad/s²]
    omega_body: Vector  # [rad/s] at the last step
    has_omega: Scalar  # 1, or 0 before the first step


def _answering(
    reference: ReferencePoint, body: Body, disturbance: Disturbance, takes_moments: bool
) -> ReferencePoint:
    """The reference less the linear and angular accelerations of a disturbance, which is in body axes."""
    body_axes = axes(body.q_world_body)
    force, turn = (
        to_world(body_axes, each) for each in (disturbance.force, disturbance.angular_acceleration)
    )
    reference = reference._replace(specific_thrust=subtract(reference.specific_thrust, force))
    if not takes_moments:
        return reference
    ahead = reference.ahead._replace(omega_dot=subtract(reference.ahead.omega_dot, turn))
    return reference._replace(
        omega_dot=subtract(reference.omega_dot, turn),
        ahead=ahead,
    )


class CommandsOnTheirWay(NamedTuple):
    """Commands of a controller that takes its time: of rotors [N], or a set-point of rates."""

    in_effect: Any
    latest: Any  # of the last tick, which takes effect next


@dataclass(frozen=True)
class ComputationDelay(Component):
    """The controller's commands, which take effect a while after they are asked for.

    Its input is 1 at the ticks at which the latest commands take effect, which may be those of the
    controller's next step.
    """

    def init(
        self, ops: Ops, parameters: tuple[()], takes_effect: Scalar, signals: Signals
    ) -> CommandsOnTheirWay:
        """See `Component.init`."""
        sent = _sent(signals.controller)
        return CommandsOnTheirWay(sent, sent)

    def step(
        self,
        ops: Ops,
        parameters: tuple[()],
        state: CommandsOnTheirWay,
        takes_effect: Scalar,
        signals: Signals,
    ) -> CommandsOnTheirWay:
        """See `Component.step`."""
        return CommandsOnTheirWay(
            select_tree(ops, takes_effect > 0.5, state.latest, state.in_effect),
            _sent(signals.controller),
        )


class PlantParameters(NamedTuple):
    """A vehicle, and where it is."""

    airframe: Airframe
    environment: EnvironmentParameters


@dataclass(frozen=True)
class RigidBodyPlant(Component):
    """Rigid body and rotors under held commands, each tick in so many steps of RK4."""

    substeps: int
    feedthrough: bool = False

    def init(
        self, ops: Ops, parameters: PlantParameters, inputs: tuple[()], signals: Signals
    ) -> VehicleState:
        """See `Component.init`; the rotors give at first what the controller takes them to give."""
        return VehicleState(signals.start, signals.controller.thrusts)

    def step(
        self, ops: Ops, parameters: PlantParameters, motion: VehicleState, inputs: tuple[()], signals: Signals
    ) -> VehicleState:
        """See `Component.step`."""
        airframe = with_ceiling(ops, parameters.airframe, signals)
        environment = with_wind(parameters.environment, signals)
        commands = commands_in_effect(signals)
        dt = signals.clock.period / self.substeps
        for _ in range(self.substeps):
            motion = motors.advance(ops, airframe, environment, motion, commands, dt)
        return motion


@dataclass(frozen=True)
class RateLoop(Component):
    """The inner loop of a flight controller, on its own gyro, behind a law that gives it rates and thrust."""

    def init(self, ops: Ops, parameters: RateLoopModel, inputs: tuple[()], signals: Signals) -> RateLoopState:
        """See `Component.init`."""
        return rate_loop.init(signals.controller.thrusts, signals.start.omega_body)

    def step(
        self,
        ops: Ops,
        parameters: RateLoopModel,
        state: RateLoopState,
        inputs: tuple[()],
        signals: Signals,
    ) -> RateLoopState:
        """See `Component.step`."""
        setpoint, elapsed = setpoint_in_effect(signals), signals.clock.elapsed
        return rate_loop.step(ops, parameters, state, setpoint, gyro(signals), elapsed)


def gyro(signals: Signals) -> Vector:
    """The body rates [rad/s] that are measured at this tick, or the true ones where there is no IMU."""
    imu = signals.find(ImuState)
    return signals.plant.body.omega_body if imu is None else imu.sample.omega


def _sent(controller: Any) -> Any:
    """The commands that a controller sends at its step: of rotors [N], or a set-point of rates."""
    setpoint = getattr(getattr(controller, "own", None), "setpoint", None)
    return controller.commands.thrusts if setpoint is None else setpoint


def setpoint_in_effect(signals: Signals) -> Any:
    """Return the commands in effect now: of rotors [N], or a set-point of rates."""
    delayed = signals.find(CommandsOnTheirWay)
    return _sent(signals.controller) if delayed is None else delayed.in_effect


def rotor_commands(signals: Signals) -> Commands:
    """The latest commands to the rotors: of the inner loop where there is one, else of the controller."""
    inner = signals.find(RateLoopState)
    return signals.controller.commands if inner is None else inner.commands


def commands_in_effect(signals: Signals) -> PerRotor:
    """The rotors' commands [N] of this tick, which may be some while old."""
    in_effect = setpoint_in_effect(signals)
    if isinstance(in_effect, RateSetpoint):
        return rotor_commands(signals).thrusts
    commands: PerRotor = in_effect
    return commands


def with_wind(environment: EnvironmentParameters, signals: Signals) -> EnvironmentParameters:
    """The environment with the wind of this tick, where the loop has a component that makes one."""
    wind = signals.find(WindState)
    return environment if wind is None else environment._replace(wind=wind.velocity)


def with_ceiling(ops: Ops, airframe: Airframe, signals: Signals) -> Airframe:
    """The airframe with what the battery leaves of its rotors' limits, where the loop has one."""
    battery = signals.find(BatteryState)
    if battery is None:
        return airframe
    rotors, ceiling = airframe.rotors, battery.ceiling
    limits = zip(rotors.min_thrust, rotors.max_thrust, strict=True)
    lowered = tuple(ops.maximum(ceiling * high, low) for low, high in limits)
    return airframe._replace(rotors=rotors._replace(max_thrust=lowered))


class LoggedEstimate(NamedTuple):
    """The estimate that a filter made from its sensors."""

    body: Body
    since_pose: Scalar  # [s] since the exposure of the last pose that it took


class LogRow(NamedTuple):
    """Row of the log, kept of each tick."""

    motion: VehicleState
    commands: Commands
    observed: LoggedEstimate | tuple[()]  # () where the true state is known
    rate_setpoint: RateSetpoint | tuple[()]  # in effect; () where no inner loop takes one


def log_row(signals: Signals) -> LogRow:
    """The row of a flight's log."""
    body, own = signals.observer
    observed = LoggedEstimate(body, own.filter.since_pose) if own else ()
    in_effect = setpoint_in_effect(signals)
    rate_setpoint = in_effect if isinstance(in_effect, RateSetpoint) else ()
    return LogRow(signals.plant, rotor_commands(signals), observed, rate_setpoint)
