"""The loop's components under conditions: wind, a sagging battery, an IMU, motion capture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.engines.engine import Coded
from aerobat.kernels import battery, imu, mocap, motors, rigid_body, wind
from aerobat.kernels.battery import BatteryParameters, BatteryState
from aerobat.kernels.imu import BiasParameters, ImuParameters, ImuSample, ImuState
from aerobat.kernels.mocap import MocapInput, MocapParameters, PoseSample
from aerobat.kernels.motors import Airframe
from aerobat.kernels.rigid_body import EnvironmentParameters
from aerobat.kernels.wind import GustNoise, WindParameters, WindState
from aerobat.simulation.components import with_wind
from aerobat.simulation.conditions.draw import Draws
from aerobat.simulation.conditions.random_source import RandomSource
from aerobat.simulation.loop import Component, Signals, Source


@dataclass(frozen=True)
class Wind(Component):
    """The wind, held from one step to the next; it acts on the plant and on the accelerometer."""

    def init(self, parameters: WindParameters, noise: GustNoise, signals: Signals) -> WindState:
        """See `Component.init`."""
        return wind.init(parameters)

    def step(
        self, parameters: WindParameters, state: WindState, noise: GustNoise, signals: Signals
    ) -> WindState:
        """See `Component.step`."""
        return wind.step(parameters, state, noise)


def wind_source(draws: Draws, period: int) -> Source:
    """Return the random numbers of gusts, for a component that steps every `period` ticks."""

    def noise(x: Sequence[Coded], *_: object) -> GustNoise:
        return GustNoise(x[0], (x[1], x[2]), (x[3], x[4]))

    return RandomSource(draws.stream("wind"), noise, normals=5, period=period, block=32).chunk


@dataclass(frozen=True)
class BatterySag(Component):
    """The battery, discharged by the rotors' thrusts; it lowers the rotors' maximum thrusts."""

    def init(self, parameters: BatteryParameters, inputs: tuple[()], signals: Signals) -> BatteryState:
        """See `Component.init`."""
        return battery.init(parameters)

    def step(
        self, parameters: BatteryParameters, state: BatteryState, inputs: tuple[()], signals: Signals
    ) -> BatteryState:
        """See `Component.step`."""
        return battery.step(signals.ops, parameters, state, signals.plant.thrusts, signals.clock.elapsed)


@dataclass(frozen=True)
class ImuBias(Component):
    """The biases of an IMU, held from one step to the next."""

    def init(self, parameters: BiasParameters, noise: ImuSample, signals: Signals) -> ImuSample:
        """See `Component.init`."""
        return parameters.start

    def step(
        self, parameters: BiasParameters, bias: ImuSample, noise: ImuSample, signals: Signals
    ) -> ImuSample:
        """See `Component.step`."""
        return imu.walk(parameters, bias, noise)


class ImuSensorParameters(NamedTuple):
    """An IMU, and the airframe and environment that determine what the IMU measures."""

    airframe: Airframe
    environment: EnvironmentParameters
    errors: ImuParameters


@dataclass(frozen=True)
class ImuSensor(Component):
    """An IMU at the centre of mass, with the biases of `ImuBias`; its sample ends at the tick of its step."""

    def init(self, parameters: ImuSensorParameters, noise: ImuSample, signals: Signals) -> ImuState:
        """See `Component.init`."""
        return imu.init()

    def step(
        self, parameters: ImuSensorParameters, state: ImuState, noise: ImuSample, signals: Signals
    ) -> ImuState:
        """See `Component.step`."""
        body, thrusts = signals.plant
        thrust = motors.collective_thrust(parameters.airframe.rotors, thrusts)
        environment = with_wind(parameters.environment, signals)
        force = rigid_body.specific_force(parameters.airframe.mass_properties, environment, body, thrust)
        true_sample = ImuSample(body.omega_body, force)
        return imu.step(signals.ops, parameters.errors, state, true_sample, signals.of(ImuSample), noise)


def imu_source(draws: Draws, stream: str, period: int, block: int = 256) -> Source:
    """Return the random numbers of an IMU's white noise, or of the walk of its biases.

    Args:
        draws: of each vehicle.
        stream: "imu" or "imu_bias".
        period: ticks from one sample to the next.
        block: samples drawn at once.
    """

    def noise(x: Sequence[Coded], *_: object) -> ImuSample:
        return ImuSample((x[0], x[1], x[2]), (x[3], x[4], x[5]))

    return RandomSource(draws.stream(stream), noise, normals=6, period=period, block=block).chunk


class MocapState(NamedTuple):
    """Poses in transit, the latest first."""

    queue: tuple[PoseSample, ...]

    @property
    def delivered(self) -> PoseSample:
        """The pose that arrived last; it stays until the exposure of its successor."""
        return self.queue[-1]


@dataclass(frozen=True)
class MotionCaptureSensor(Component):
    """Motion capture: a pose is taken at every step and arrives `latency` ticks later.

    The component steps at exposures only. At the tick t of an arrival, `MocapState.delivered` is the pose of
    tick t − latency. Before the first arrival it is a pose from before the flight, marked invalid as a
    measurement, with a random error of its own.
    """

    period: int  # ticks from one exposure to the next
    latency: int  # ticks

    def init(self, parameters: MocapParameters, inputs: MocapInput, signals: Signals) -> MocapState:
        """See `Component.init`."""
        known = PoseSample(mocap.first_pose(signals.ops, parameters, signals.start), 0.0)
        return MocapState((known,) * (self.latency // self.period + 1))

    def step(
        self, parameters: MocapParameters, state: MocapState, inputs: MocapInput, signals: Signals
    ) -> MocapState:
        """See `Component.step`."""
        taken = mocap.sample(signals.ops, parameters, signals.plant.body, inputs)
        return MocapState((taken, *state.queue[:-1]))


def mocap_source(draws: Draws, period: int, rate: float) -> Source:
    """Return the time, and the random numbers of motion capture.

    Args:
        draws: of each vehicle.
        period: ticks from one sample to the next.
        rate: of the ticks [1/s].
    """

    def sampled(x: Sequence[Coded], chance: Array, ticks: NDArray[np.intp]) -> MocapInput:
        return MocapInput(ticks / rate, (x[0], x[1], x[2]), (x[3], x[4], x[5]), (x[6], x[7], x[8]), chance[0])

    return RandomSource(
        draws.stream("motion_capture"), sampled, normals=9, uniforms=1, period=period, block=32
    ).chunk
