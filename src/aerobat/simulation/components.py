"""Components that every simulation loop has: observer, controller, computation delay and plant."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

from aerobat.kernels import control, motors, rate_loop
from aerobat.kernels.battery import BatteryState
from aerobat.kernels.control import Commands, ControllerModel, ControllerState, Controlling
from aerobat.kernels.control_loops import FeatureFlags, ReferencePoint
from aerobat.kernels.imu import ImuState
from aerobat.kernels.motors import Airframe, VehicleState
from aerobat.kernels.ops import PerRotor, Scalar, Vector, select_tree
from aerobat.kernels.quaternions import axes, to_world
from aerobat.kernels.rate_loop import RateLoopModel, RateLoopState, RateSetpoint
from aerobat.kernels.rigid_body import Body, EnvironmentParameters
from aerobat.kernels.vectors import subtract
from aerobat.kernels.wind import WindState
from aerobat.simulation.loop import Component, Estimate, Signals

MAX_STEP = 0.002  # [s] largest step of RK4: integrates the fastest flips to within 1e-6 m


def rigid_body_steps(duration: float) -> int:
    """Return the number of RK4 steps in which a rigid body is advanced by a duration [s]."""
    return max(1, math.ceil(duration / MAX_STEP - 1e-9))


@dataclass(frozen=True)
class StateObserver(Component):
    """The observer that returns the true state."""

    def init(self, parameters: tuple[()], signals: Signals) -> Estimate:
        """See `Component.init`."""
        return Estimate(signals.start)

    def step(self, parameters: tuple[()], state: Estimate, signals: Signals) -> Estimate:
        """See `Component.step`."""
        return Estimate(signals.plant.body)


class ControllerParameters(NamedTuple):
    """The model of a controller, and the delay of its commands."""

    model: ControllerModel
    delay: Scalar | tuple[()]  # [s] from the state to the effect of its commands; () for no delay


@dataclass(frozen=True)
class TrackingController(Component):
    """The tracking controller, which takes the body's state from the observer.

    It tracks a reference from its own inputs if its commands are delayed, else the reference of the tick.
    """

    flags: FeatureFlags

    def init(self, parameters: ControllerParameters, signals: Signals) -> ControllerState:
        """See `Component.init`."""
        reference = signals.inputs or signals.reference
        return control.init(signals.ops, parameters.model, signals.observer.body, reference)

    def step(
        self, parameters: ControllerParameters, state: ControllerState, signals: Signals
    ) -> ControllerState:
        """See `Component.step`."""
        body, reference = controller_inputs(parameters, state, signals)
        ops, elapsed = signals.ops, signals.clock.elapsed
        return control.step(ops, self.flags, parameters.model, state, body, reference, elapsed)


def controller_inputs(
    parameters: ControllerParameters,
    state: Controlling,
    signals: Signals,
    takes_forces: bool = True,
    takes_moments: bool = True,
) -> tuple[Body, ReferencePoint]:
    """Return the state when the commands take effect, and the reference corrected for the disturbance.

    Args:
        parameters: A controller and its delay.
        state: The controller's state, of which the thrusts and the last commands are used.
        signals: Its signals; its input is a reference of its own if its commands are delayed, else ().
        takes_forces: Whether the estimated disturbing force is subtracted from the reference.
        takes_moments: Whether the estimated disturbing moment is, too; only with `takes_forces`.
    """
    body, reference = signals.observer.body, signals.inputs or signals.reference
    disturbance = signals.find(Disturbance)
    if takes_forces and disturbance is not None:
        reference = _compensated(reference, body, disturbance, takes_moments)
    if not isinstance(parameters.delay, tuple):
        elapsed = signals.clock.elapsed
        body = control.predicted(signals.ops, parameters.model, state, body, elapsed, parameters.delay)
    return body, reference


class Disturbance(NamedTuple):
    """The estimated disturbance that the nominal model does not explain, in body axes.

    Body axes are used because most disturbances, such as a mismatch of rotors, turn with the body.
    """

    force: Vector  # [m/s²] disturbing force over mass
    angular_acceleration: Vector  # [rad/s²]
    omega_body: Vector  # [rad/s] at the last step
    has_omega: Scalar  # 1, or 0 before the first step


def _compensated(
    reference: ReferencePoint, body: Body, disturbance: Disturbance, takes_moments: bool
) -> ReferencePoint:
    """Return the reference less the linear and angular accelerations of a disturbance in body axes."""
    body_axes = axes(body.q_world_body)
    force, turn = (
        to_world(body_axes, each) for each in (disturbance.force, disturbance.angular_acceleration)
    )
    reference = reference._replace(specific_thrust=subtract(reference.specific_thrust, force))
    if not takes_moments:
        return reference
    ahead = reference.ahead._replace(omega_dot=subtract(reference.ahead.omega_dot, turn))
    return reference._replace(omega_dot=subtract(reference.omega_dot, turn), ahead=ahead)


class DelayedCommands(NamedTuple):
    """Commands of a controller with computation delay: rotor thrusts [N], or a set-point of body rates."""

    in_effect: Any
    latest: Any  # commands of the last tick, which take effect next


@dataclass(frozen=True)
class ComputationDelay(Component):
    """The computation delay between the controller's step and the effect of its commands.

    Its input is 1 at the ticks at which the latest commands take effect. Such a tick may be one at which the
    controller already computes its next commands.
    """

    def init(self, parameters: tuple[()], signals: Signals) -> DelayedCommands:
        """See `Component.init`."""
        sent = _sent_commands(signals.controller)
        return DelayedCommands(sent, sent)

    def step(self, parameters: tuple[()], state: DelayedCommands, signals: Signals) -> DelayedCommands:
        """See `Component.step`."""
        takes_effect = signals.inputs > 0.5
        in_effect = select_tree(signals.ops, takes_effect, state.latest, state.in_effect)
        return DelayedCommands(in_effect, _sent_commands(signals.controller))


class PlantParameters(NamedTuple):
    """A vehicle and its environment."""

    airframe: Airframe
    environment: EnvironmentParameters


@dataclass(frozen=True)
class RigidBodyPlant(Component):
    """Rigid body and rotors under held commands, integrated by a fixed number of RK4 steps per tick."""

    substeps: int
    feedthrough: bool = False

    def init(self, parameters: PlantParameters, signals: Signals) -> VehicleState:
        """See `Component.init`; the initial rotor thrusts are those that the controller assumes."""
        return VehicleState(signals.start, signals.controller.thrusts)

    def step(self, parameters: PlantParameters, motion: VehicleState, signals: Signals) -> VehicleState:
        """See `Component.step`."""
        airframe = with_ceiling(parameters.airframe, signals)
        environment = with_wind(parameters.environment, signals)
        commands = commands_in_effect(signals)
        dt = signals.clock.period / self.substeps
        for _ in range(self.substeps):
            motion = motors.advance(signals.ops, airframe, environment, motion, commands, dt)
        return motion


@dataclass(frozen=True)
class RateLoop(Component):
    """The inner loop of a flight controller, which tracks commanded body rates and thrust by its own gyro."""

    def init(self, parameters: RateLoopModel, signals: Signals) -> RateLoopState:
        """See `Component.init`."""
        return rate_loop.init(signals.controller.thrusts, signals.start.omega_body)

    def step(self, parameters: RateLoopModel, state: RateLoopState, signals: Signals) -> RateLoopState:
        """See `Component.step`."""
        setpoint, elapsed = setpoint_in_effect(signals), signals.clock.elapsed
        return rate_loop.step(signals.ops, parameters, state, setpoint, gyro(signals), elapsed)


def gyro(signals: Signals) -> Vector:
    """Return the body rates [rad/s] measured at this tick, or the true ones where there is no IMU."""
    imu = signals.find(ImuState)
    return signals.plant.body.omega_body if imu is None else imu.sample.omega


def _sent_commands(controller: Any) -> Any:
    """Return the commands that a controller sends at its step: rotor thrusts [N], or a set-point of rates."""
    setpoint = getattr(getattr(controller, "own", None), "setpoint", None)
    return controller.commands.thrusts if setpoint is None else setpoint


def setpoint_in_effect(signals: Signals) -> Any:
    """Return the commands in effect now: rotor thrusts [N], or a set-point of rates."""
    delayed = signals.find(DelayedCommands)
    return _sent_commands(signals.controller) if delayed is None else delayed.in_effect


def rotor_commands(signals: Signals) -> Commands:
    """Return the latest rotor commands: of the inner loop if there is one, else of the controller."""
    inner = signals.find(RateLoopState)
    return signals.controller.commands if inner is None else inner.commands


def commands_in_effect(signals: Signals) -> PerRotor:
    """Return the rotor commands [N] in effect at this tick, which may be delayed."""
    in_effect = setpoint_in_effect(signals)
    if isinstance(in_effect, RateSetpoint):
        return rotor_commands(signals).thrusts
    commands: PerRotor = in_effect
    return commands


def with_wind(environment: EnvironmentParameters, signals: Signals) -> EnvironmentParameters:
    """Return the environment with the wind of this tick, if the loop has a component for wind."""
    wind = signals.find(WindState)
    return environment if wind is None else environment._replace(wind=wind.velocity)


def with_ceiling(airframe: Airframe, signals: Signals) -> Airframe:
    """Return the airframe with the maximum thrusts that the battery allows, if the loop has a battery."""
    battery = signals.find(BatteryState)
    if battery is None:
        return airframe
    rotors, ceiling = airframe.rotors, battery.ceiling
    limits = zip(rotors.min_thrust, rotors.max_thrust, strict=True)
    lowered = tuple(signals.ops.maximum(ceiling * high, low) for low, high in limits)
    return airframe._replace(rotors=rotors._replace(max_thrust=lowered))


class LoggedEstimate(NamedTuple):
    """The state as estimated by a filter from its sensors."""

    body: Body
    since_pose: Scalar  # [s] since the exposure of the last pose that the filter took


class LogRow(NamedTuple):
    """One row of the log, recorded at each tick."""

    motion: VehicleState
    commands: Commands
    observed: LoggedEstimate | tuple[()]  # () where the true state is known
    rate_setpoint: RateSetpoint | tuple[()]  # set-point in effect; () without an inner loop


def log_row(signals: Signals) -> LogRow:
    """Return the row of a flight's log."""
    body, own = signals.observer
    observed = LoggedEstimate(body, own.filter.since_pose) if own else ()
    in_effect = setpoint_in_effect(signals)
    rate_setpoint = in_effect if isinstance(in_effect, RateSetpoint) else ()
    return LogRow(signals.plant, rotor_commands(signals), observed, rate_setpoint)
