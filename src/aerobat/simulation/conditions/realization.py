"""Flights drawn from conditions: the true vehicles, their starts, disturbances, sensors and filter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from aerobat.environment import Dispersion
from aerobat.errors import SpecError
from aerobat.estimation import Ekf, ekf_parameters
from aerobat.kernels.control import ControllerModel
from aerobat.problem.gate import Gate
from aerobat.simulation.bodies import bodies
from aerobat.simulation.components import StateObserver
from aerobat.simulation.conditions.draw import Draws, dispersed_fleet
from aerobat.simulation.conditions.observer import (
    DisturbanceObserver,
    DisturbanceParameters,
    EkfObserver,
    ObserverParameters,
    observer_source,
)
from aerobat.simulation.conditions.parts import TICK_TOLERANCE, DispersedFlights, condition_parts, whole_ticks
from aerobat.simulation.conditions.sensors import MotionCaptureSensor
from aerobat.simulation.config import FlightConfig
from aerobat.simulation.loop import LoopPart
from aerobat.simulation.reference_source import ReferenceSource
from aerobat.simulation.setup import Realization

MAX_TICKS = 20  # largest number of ticks in a period of the controller, where no IMU sets the rate
_MIN_START_VELOCITY = 0.01  # [m/s] smallest initial standard deviation of velocity in the filter
_MAX_OBSERVER_LAG = 0.05  # [s] largest rotor lag with a disturbance observer: slower rotors answer too late


def realization(
    conditions: Dispersion,
    reference: ReferenceSource,
    gates: tuple[Gate, ...],
    config: FlightConfig,
    model: ControllerModel,
) -> Realization:
    """Return the flights of a config, drawn from conditions.

    Args:
        conditions: the distributions to draw from; they determine the rate of the ticks.
        reference: the path for the nominal vehicle, in an environment without gusts.
        gates: on the way; the first one is the default plane of a hand-off.
        config: with the seed and the numbers of the flights.
        model: the controller's, of the nominal vehicle.

    Raises SpecError for rates that do not fit each other, and for a delay of more than a period of the
    controller.
    """
    rate = _tick_rate(conditions, config.control_rate)
    period = whole_ticks(rate, config.control_rate, "control_rate")
    delay = round(conditions.computation_delay * rate)
    if delay > period:
        raise SpecError(
            f"computation_delay must be at most a period of the controller, {period / rate:g} s, "
            f"got {conditions.computation_delay:g} s; lower control_rate"
        )
    reference = replace(reference, rate=rate)
    nominal = reference.vehicle
    draws = Draws(conditions, len(nominal.rotors), config.seed, config.flights or range(1))
    flights = DispersedFlights(draws, dispersed_fleet(nominal, draws), reference, gates)
    disturbances = condition_parts(conditions, flights)
    observers: tuple[LoopPart, ...] = (_observer(conditions, flights, disturbances),)
    slowest = max(rotor.lag for rotor in nominal.rotors)
    filtering = config.controller_of([nominal]).disturbance_filter
    if filtering > 0.0 and conditions.imu is not None and slowest <= _MAX_OBSERVER_LAG:
        # a filter faster than the rotors takes errors of their modelled lag for disturbances: unstable
        parameters = DisturbanceParameters(model, max(filtering, slowest), delay / rate)
        observers += (LoopPart(DisturbanceObserver(), parameters, period=period),)
    return Realization(
        reference=reference,
        fleet=flights.fleet,
        start=bodies(draws.starts(reference.start)),
        effectiveness=flights.effectiveness,
        disturbances=disturbances,
        observers=observers,
        period=period,
        delay=delay,
    )


def _tick_rate(conditions: Dispersion, control_rate: float) -> float:
    """Return the tick rate [1/s]: the IMU's, or the lowest with control period and delay in whole ticks."""
    delay, imu = conditions.computation_delay, conditions.imu
    rates = [control_rate * k for k in range(1, MAX_TICKS + 1)] if imu is None else [imu.rate]
    for rate in rates:
        if abs(delay * rate - round(delay * rate)) < TICK_TOLERANCE:
            return rate
    tick = 1.0 / rates[-1]
    lasting = f"which last {tick:g} s or longer" if imu is None else f"which last {tick:g} s by imu.rate"
    raise SpecError(
        f"computation_delay must be a whole number of ticks, {lasting}, got {delay:g} s; change one"
    )


def _observer(conditions: Dispersion, flights: DispersedFlights, disturbed: Sequence[LoopPart]) -> LoopPart:
    """Return the Kalman filter behind the sensors, or, without sensors, the observer of the true state."""
    imu, capture = conditions.imu, conditions.motion_capture
    if imu is None or capture is None:
        return LoopPart(StateObserver())
    sensor = next(p.component for p in disturbed if isinstance(p.component, MotionCaptureSensor))
    settings = Ekf.of_sensors(imu, capture, max(conditions.start_velocity, _MIN_START_VELOCITY))
    parameters = ekf_parameters(settings, flights.reference.environment.gravity, len(flights.draws))
    return LoopPart(
        EkfObserver(sensor.period, sensor.latency),
        ObserverParameters(parameters, 1.0 / flights.reference.rate),
        observer_source(sensor, flights.reference.rate),
    )
