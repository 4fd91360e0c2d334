"""Parts of the loop made from a flight's conditions: components, their parameters and sources of inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.control.parameters import airframe_parameters, environment_parameters
from aerobat.engines.pytree import Tree, components
from aerobat.environment import Battery, Dispersion, Gusts, HandOff, Imu, MotionCapture
from aerobat.errors import SpecError
from aerobat.kernels.battery import BatteryParameters
from aerobat.kernels.imu import BiasParameters, ImuParameters, ImuSample
from aerobat.kernels.mocap import HandOffParameters, MocapParameters
from aerobat.kernels.rigid_body import Pose
from aerobat.kernels.wind import GustFilter, GustState, WindParameters
from aerobat.problem import Gate
from aerobat.simulation.conditions.draw import Draws
from aerobat.simulation.conditions.random_source import RandomSource
from aerobat.simulation.conditions.sensors import (
    GUST_NOISE,
    IMU_NOISE,
    MOCAP_INPUT,
    BatterySag,
    ImuBias,
    ImuSensor,
    ImuSensorParameters,
    MotionCaptureSensor,
    Wind,
)
from aerobat.simulation.loop import LoopPart
from aerobat.simulation.reference_source import ReferenceSource
from aerobat.trajectory import Trajectory
from aerobat.vehicle.fleet import Fleet

SLOW_RATE = 100.0  # [1/s] rate of slow components: sensor biases, battery charge, and wind without fast gusts
GUST_STEPS = 20.0  # [-] steps of the wind in one time constant of its gusts
MAX_QUEUE = 8  # largest number of poses in transit at once
TICK_TOLERANCE = 1e-6  # [-] relative tolerance of whole numbers of ticks
_MIN_SPEED = 1e-3  # [m/s] a slower path has no direction


@dataclass(frozen=True, eq=False)
class DispersedFlights:
    """The flights for which conditions are made."""

    draws: Draws
    fleet: Fleet  # vehicles that really fly, unlike the nominal one
    reference: ReferenceSource  # with the nominal vehicle, the environment without gusts, and the ticks' rate
    gates: tuple[Gate, ...] = ()  # on the way; the first gate is the default plane of a hand-off

    def each(self, name: str) -> Tree:
        """Return a field of the draws: a leaf (vehicles,), or for an array a tuple of leaves."""
        values = self.draws.columns[name]
        return values if values.ndim == 1 else components(values)

    @property
    def effectiveness(self) -> Array:
        """The effectiveness of the rotors [-], (vehicles, n)."""
        return self.draws.columns["effectiveness"]

    def slow_period(self, rate: float = SLOW_RATE) -> int:
        """Return the ticks per step of a component that steps at `rate` [1/s], or somewhat faster."""
        return max(1, int(self.reference.rate / rate + TICK_TOLERANCE))


def condition_parts(dispersion: Dispersion, flights: DispersedFlights) -> tuple[LoopPart, ...]:
    """Return the parts of some conditions, in their order in the loop, before observer, controller and plant.

    Raises SpecError for sensors whose rates do not fit the ticks.
    """
    parts = []
    if dispersion.gusts is not None:
        parts.append(wind_part(dispersion.gusts, flights))
    if dispersion.battery is not None:
        parts.append(battery_part(dispersion.battery, flights))
    if dispersion.imu is not None:
        parts += imu_parts(dispersion.imu, flights)
    if dispersion.motion_capture is not None:
        parts.append(motion_capture_part(dispersion.motion_capture, flights))
    return tuple(parts)


def wind_part(gusts: Gusts, flights: DispersedFlights) -> LoopPart:
    """Return the part for mean wind and gusts."""
    time_constant = gusts.length / gusts.airspeed
    period = flights.slow_period(max(SLOW_RATE, GUST_STEPS / time_constant))
    mean = flights.reference.environment.wind + flights.draws.columns["mean_wind"]
    speed = np.hypot(mean[:, 0], mean[:, 1])
    heading = flights.draws.columns["gust_heading"]
    is_calm = speed == 0.0
    divisor = np.where(is_calm, 1.0, speed)
    along, first, second, third, fourth = flights.each("gust")
    parameters = WindParameters(
        components(mean),
        (
            np.where(is_calm, np.cos(heading), mean[:, 0] / divisor),
            np.where(is_calm, np.sin(heading), mean[:, 1] / divisor),
        ),
        gusts.intensity,
        gust_filter(period / flights.reference.rate / time_constant),
        GustState(along, (first, second), (third, fourth)),
    )
    noise = RandomSource(flights.draws.stream("wind"), GUST_NOISE, period=period, block=32)
    return LoopPart(Wind(), parameters, noise.chunk, period)


def gust_filter(step: float) -> GustFilter:
    """Return the exact discretisation of the gust filters over `step` of their time constants [-].

    The two filters of a lateral component have the stationary covariance P = (1/2, 1/4; 1/4, 1/4) and the
    transition Φ = e^(−h) (1, 0; h, 1); their inputs have the covariance P − Φ P Φᵀ.
    """
    decay = np.exp(-step)
    lost = -np.expm1(-2.0 * step)  # 1 − e^(−2h)
    kept = decay**2
    first = np.sqrt(0.5 * lost)
    both = 0.25 * lost - 0.5 * kept * step
    second = 0.25 * lost - 0.5 * kept * (step + step**2)
    cross = both / first
    across = first, cross, np.sqrt(max(second - cross**2, 0.0))
    return GustFilter(decay, step * decay, np.sqrt(lost), across)


def battery_part(battery: Battery, flights: DispersedFlights) -> LoopPart:
    """Return the part for a battery that hover of the nominal vehicle empties within its endurance."""
    vehicle = flights.reference.vehicle
    weight = vehicle.mass * flights.reference.environment.gravity
    hover = weight * np.abs(vehicle.mixer[:, 0])
    radii = np.array([rotor.radius for rotor in vehicle.rotors])
    hover_power = np.sum(hover**1.5 / radii)
    usage = flights.effectiveness**1.5 / radii / hover_power / battery.endurance
    parameters = BatteryParameters(flights.each("charge"), components(usage), battery.sag)
    return LoopPart(BatterySag(), parameters, period=flights.slow_period())


def imu_parts(imu: Imu, flights: DispersedFlights) -> tuple[LoopPart, LoopPart]:
    """Return the parts for an IMU's biases and for the IMU."""
    slow = flights.slow_period()
    walk = np.sqrt(slow / flights.reference.rate)
    biases = BiasParameters(
        ImuSample(flights.each("gyro_bias"), flights.each("accelerometer_bias")),
        imu.gyro_bias_walk * walk,
        imu.accelerometer_bias_walk * walk,
    )
    period = whole_ticks(flights.reference.rate, imu.rate, "imu.rate")
    noise = np.sqrt(imu.rate)
    parameters = ImuSensorParameters(
        airframe_parameters(flights.fleet, flights.effectiveness),
        environment_parameters(flights.reference.environment, len(flights.draws)),
        ImuParameters(
            imu.gyro_noise * noise, imu.accelerometer_noise * noise, imu.gyro_range, imu.accelerometer_range
        ),
    )
    steps = RandomSource(flights.draws.stream("imu_bias"), IMU_NOISE, period=slow, block=32)
    white = RandomSource(flights.draws.stream("imu"), IMU_NOISE, period=period)
    return (
        LoopPart(ImuBias(), biases, steps.chunk, slow),
        LoopPart(ImuSensor(), parameters, white.chunk, period),
    )


def motion_capture_part(capture: MotionCapture, flights: DispersedFlights) -> LoopPart:
    """Return the part for motion capture."""
    period = whole_ticks(flights.reference.rate, capture.rate, "motion_capture.rate")
    latency = round(capture.latency * flights.reference.rate)
    if latency >= MAX_QUEUE * period:
        raise SpecError(
            f"motion_capture.latency must be below {MAX_QUEUE} periods of its rate, "
            f"{MAX_QUEUE / capture.rate:g} s, got {capture.latency:g} s"
        )
    begin = end = np.inf
    if capture.outage is not None:
        begin, end = capture.outage.start, capture.outage.start + capture.outage.duration
    parameters = MocapParameters(
        position_noise=capture.position_noise,
        attitude_noise=capture.attitude_noise,
        dropout=capture.dropout,
        outlier=capture.outlier,
        outlier_size=capture.outlier_size,
        outage=(begin, end),
        hand_off=_hand_off_parameters(capture.hand_off or HandOff(), flights),
        first_error=(flights.each("first_position_error"), flights.each("first_attitude_error")),
    )
    stream = flights.draws.stream("motion_capture")
    source = RandomSource(stream, MOCAP_INPUT, period=period, block=32, rate=flights.reference.rate)
    return LoopPart(MotionCaptureSensor(period, latency), parameters, source.chunk, period)


def _hand_off_parameters(hand_off: HandOff, flights: DispersedFlights) -> HandOffParameters:
    """Return the plane of hand-off and the misfit there, which is zero by default."""
    point, normal = hand_off_plane(hand_off, flights.reference.trajectory, flights.gates)
    rotation = so3.exp(flights.draws.columns["hand_off_rotation"])
    return HandOffParameters(
        components(point),
        components(normal),
        Pose(flights.each("hand_off_translation"), components(rotation)),
        flights.each("warp"),
        1.0 / hand_off.warp_depth,
    )


def hand_off_plane(hand_off: HandOff, path: Trajectory, gates: Sequence[Gate]) -> tuple[Array, Array]:
    """Return point [m] and unit normal of the plane of hand-off, (3,) each.

    The default is the first gate's plane or, without gates, the plane across the trajectory at half its time.
    """
    half = 0.5 * path.duration
    point = gates[0].position if gates else path.evaluate(half, 0)
    velocity = path.evaluate(half, 1)
    speed = float(np.linalg.norm(velocity))
    ahead = velocity / speed if speed > _MIN_SPEED else np.array([1.0, 0.0, 0.0])
    normal = gates[0].normal if gates else ahead
    return (
        point if hand_off.point is None else hand_off.point,
        normal if hand_off.normal is None else hand_off.normal,
    )


def whole_ticks(rate: float, sensor_rate: float, field: str) -> int:
    """Return a sensor's period in ticks at `rate` [1/s]. Raises SpecError, naming `field`, for fractions."""
    ticks = rate / sensor_rate
    if ticks < 1.0 - TICK_TOLERANCE or abs(ticks - round(ticks)) > TICK_TOLERANCE * ticks:
        raise SpecError(
            f"{field} must be the simulation's rate ({rate:g} 1/s) over a whole number, got {sensor_rate:g}"
        )
    return round(ticks)
