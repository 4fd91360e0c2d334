"""The loop's components that every flight has: what the controller sees, the controller, the plant."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from aerobat.kernels import control, motors
from aerobat.kernels.control import Commands, ControllerModel, ControllerState, FeatureFlags
from aerobat.kernels.motors import Airframe, Motion
from aerobat.kernels.ops import Ops
from aerobat.kernels.quaternions import multiply
from aerobat.kernels.rigid_body import Body, EnvironmentParameters
from aerobat.kernels.vectors import add
from aerobat.simulation.loop import Signals

MAX_STEP = 0.002  # [s] of RK4: enough for 1e-6 m in the fastest flips


@dataclass(frozen=True)
class StateObserver:
    """The true state with the errors that come as its inputs, a body, or () for none."""

    period: int = 1
    name: str = "observer"
    feedthrough: bool = True

    def init(self, ops: Ops, parameters: tuple[()], error: Body | tuple[()], signals: Signals) -> Body:
        """See `Component.init`."""
        return _observed(signals["start"], error)

    def step(
        self, ops: Ops, parameters: tuple[()], state: Body, error: Body | tuple[()], signals: Signals
    ) -> Body:
        """See `Component.step`."""
        return _observed(signals["plant"].body, error)


def _observed(body: Body, error: Body | tuple[()]) -> Body:
    if not error:
        return body
    return Body(
        add(body.position, error.position),
        add(body.velocity, error.velocity),
        multiply(body.q_world_body, error.q_world_body),
        add(body.omega_body, error.omega_body),
    )


@dataclass(frozen=True)
class TrackingController:
    """The tracking controller, told of the body by the observer."""

    flags: FeatureFlags
    period: int = 1
    name: str = "controller"
    feedthrough: bool = True

    def init(self, ops: Ops, model: ControllerModel, inputs: tuple[()], signals: Signals) -> ControllerState:
        """See `Component.init`."""
        return control.init(ops, model, signals["observer"], signals["reference"])

    def step(
        self, ops: Ops, model: ControllerModel, state: ControllerState, inputs: tuple[()], signals: Signals
    ) -> ControllerState:
        """See `Component.step`."""
        elapsed = signals["clock"].elapsed
        return control.step(ops, self.flags, model, state, signals["observer"], signals["reference"], elapsed)


class PlantParameters(NamedTuple):
    """A vehicle, and where it is."""

    airframe: Airframe
    environment: EnvironmentParameters


@dataclass(frozen=True)
class RigidBodyPlant:
    """Rigid body and rotors under held commands, each tick in so many steps of RK4."""

    substeps: int
    period: int = 1
    name: str = "plant"
    feedthrough: bool = False

    @classmethod
    def for_rate(cls, rate: float) -> RigidBodyPlant:
        """The plant for so many ticks a second."""
        return cls(max(1, math.ceil(1.0 / rate / MAX_STEP - 1e-9)))

    def init(self, ops: Ops, parameters: PlantParameters, inputs: tuple[()], signals: Signals) -> Motion:
        """See `Component.init`; the rotors give at first what the controller takes them to give."""
        return Motion(signals["start"], signals["controller"].thrusts)

    def step(
        self, ops: Ops, parameters: PlantParameters, motion: Motion, inputs: tuple[()], signals: Signals
    ) -> Motion:
        """See `Component.step`."""
        airframe = with_ceiling(ops, parameters.airframe, signals)
        environment = with_wind(parameters.environment, signals)
        commands = signals["controller"].commands.thrusts
        dt = signals["clock"].period / self.substeps
        for _ in range(self.substeps):
            motion = motors.advance(ops, airframe, environment, motion, commands, dt)
        return motion


def with_wind(environment: EnvironmentParameters, signals: Signals) -> EnvironmentParameters:
    """The environment with the wind of this tick, where the loop has a component of that name."""
    return environment._replace(wind=signals["wind"].velocity) if "wind" in signals else environment


def with_ceiling(ops: Ops, airframe: Airframe, signals: Signals) -> Airframe:
    """The airframe with what the battery leaves of its rotors' limits, where the loop has one."""
    if "battery" not in signals:
        return airframe
    rotors, ceiling = airframe.rotors, signals["battery"].ceiling
    limits = zip(rotors.min_thrust, rotors.max_thrust, strict=True)
    lowered = tuple(ops.maximum(ceiling * high, low) for low, high in limits)
    return airframe._replace(rotors=rotors._replace(max_thrust=lowered))


class LogRow(NamedTuple):
    """Row of the log, kept of each tick."""

    motion: Motion
    commands: Commands


def log_row(signals: Signals) -> LogRow:
    """The row of a flight's log."""
    return LogRow(signals["plant"], signals["controller"].commands)
