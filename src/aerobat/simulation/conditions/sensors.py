"""The loop's components under conditions: wind, a sagging battery, an IMU, motion capture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from aerobat.kernels import battery, imu, mocap, motors, rigid_body, wind
from aerobat.kernels.battery import BatteryParameters, BatteryState
from aerobat.kernels.imu import BiasParameters, ImuParameters, ImuSample, ImuState
from aerobat.kernels.mocap import MocapInput, MocapParameters, PoseSample
from aerobat.kernels.motors import Airframe
from aerobat.kernels.rigid_body import EnvironmentParameters
from aerobat.kernels.wind import GustNoise, WindParameters, WindState
from aerobat.simulation.components import with_wind
from aerobat.simulation.conditions.random_source import InputNumber
from aerobat.simulation.loop import Component, Signals

_NORMAL, _NORMALS = InputNumber.NORMAL, (InputNumber.NORMAL,) * 3
# random inputs of the components
GUST_NOISE = GustNoise(_NORMAL, (_NORMAL, _NORMAL), (_NORMAL, _NORMAL))
IMU_NOISE = ImuSample(_NORMALS, _NORMALS)  # of its white noise, and of the walk of its biases
MOCAP_INPUT = MocapInput(InputNumber.TIME, _NORMALS, _NORMALS, _NORMALS, InputNumber.UNIFORM)


@dataclass(frozen=True)
class Wind(Component):
    """The wind, held from one step to the next; it acts on the plant and on the accelerometer."""

    def init(self, parameters: WindParameters, signals: Signals) -> WindState:
        """See `Component.init`."""
        return wind.init(parameters)

    def step(self, parameters: WindParameters, state: WindState, signals: Signals) -> WindState:
        """See `Component.step`."""
        return wind.step(parameters, state, signals.inputs)


@dataclass(frozen=True)
class BatterySag(Component):
    """The battery, discharged by the rotors' thrusts; it lowers the rotors' maximum thrusts."""

    def init(self, parameters: BatteryParameters, signals: Signals) -> BatteryState:
        """See `Component.init`."""
        return battery.init(parameters)

    def step(self, parameters: BatteryParameters, state: BatteryState, signals: Signals) -> BatteryState:
        """See `Component.step`."""
        return battery.step(signals.ops, parameters, state, signals.plant.thrusts, signals.clock.elapsed)


@dataclass(frozen=True)
class ImuBias(Component):
    """The biases of an IMU, held from one step to the next."""

    def init(self, parameters: BiasParameters, signals: Signals) -> ImuSample:
        """See `Component.init`."""
        return parameters.start

    def step(self, parameters: BiasParameters, bias: ImuSample, signals: Signals) -> ImuSample:
        """See `Component.step`."""
        return imu.walk(parameters, bias, signals.inputs)


class ImuSensorParameters(NamedTuple):
    """An IMU, and the airframe and environment that determine what the IMU measures."""

    airframe: Airframe
    environment: EnvironmentParameters
    errors: ImuParameters


@dataclass(frozen=True)
class ImuSensor(Component):
    """An IMU at the centre of mass, with the biases of `ImuBias`; its sample ends at the tick of its step."""

    def init(self, parameters: ImuSensorParameters, signals: Signals) -> ImuState:
        """See `Component.init`."""
        return imu.init()

    def step(self, parameters: ImuSensorParameters, state: ImuState, signals: Signals) -> ImuState:
        """See `Component.step`."""
        body, thrusts = signals.plant
        thrust = motors.collective_thrust(parameters.airframe.rotors, thrusts)
        environment = with_wind(parameters.environment, signals)
        force = rigid_body.specific_force(parameters.airframe.mass_properties, environment, body, thrust)
        true_sample = ImuSample(body.omega_body, force)
        ops, biases, noise = signals.ops, signals.of(ImuSample), signals.inputs
        return imu.step(ops, parameters.errors, state, true_sample, biases, noise)


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

    def init(self, parameters: MocapParameters, signals: Signals) -> MocapState:
        """See `Component.init`."""
        known = PoseSample(mocap.first_pose(signals.ops, parameters, signals.start), 0.0)
        return MocapState((known,) * (self.latency // self.period + 1))

    def step(self, parameters: MocapParameters, state: MocapState, signals: Signals) -> MocapState:
        """See `Component.step`."""
        taken = mocap.sample(signals.ops, parameters, signals.plant.body, signals.inputs)
        return MocapState((taken, *state.queue[:-1]))
