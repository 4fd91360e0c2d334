"""Setups of flights under conditions: the true vehicles, their starts, sensors, filter and controller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from aerobat.environment import Dispersion, Environment
from aerobat.errors import SpecError
from aerobat.estimation import Ekf, ekf_parameters
from aerobat.flatness import Planned
from aerobat.simulation.bodies import bodies
from aerobat.simulation.components import ComputationDelay, ControllerParameters, StateObserver
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
from aerobat.simulation.law_controller import controller_component, inner_loop
from aerobat.simulation.loop import LoopPart, due_ticks
from aerobat.simulation.reference_source import ReferenceSource
from aerobat.simulation.setup import FlightSetup, controller_model, plant_part
from aerobat.trajectory import Trajectory, as_trajectory
from aerobat.vehicle import Vehicle
from aerobat.vehicle.controller import Controller
from aerobat.vehicle.fleet import Fleet

MAX_TICKS = 20  # largest number of ticks in a period of the controller, where no IMU sets the rate
_MIN_START_VELOCITY = 0.01  # [m/s] smallest initial standard deviation of velocity in the filter
_MAX_OBSERVER_LAG = 0.05  # [s] largest rotor lag with a disturbance observer: slower rotors answer too late


def dispersed_setup(
    plan: Planned | Trajectory,
    nominal: Vehicle,
    environment: Environment,
    config: FlightConfig,
    conditions: Dispersion,
) -> FlightSetup:
    """Return the setup of the flights of a config under conditions.

    Args:
        plan: the plan or trajectory to fly.
        nominal: the vehicle that the controller knows.
        environment: the surroundings, without gusts.
        config: with the seed and the numbers of the flights.
        conditions: the distributions to draw from.

    Raises SpecError for a vehicle that cannot hover, for rates that do not fit each other, and for a delay of
    more than a period of the controller.
    """
    nominal.without_dead_rotors()
    rate = _tick_rate(conditions, config.control_rate)
    numbers = config.flights or range(1)
    draws = Draws(conditions, len(nominal.rotors), config.seed, numbers)
    controller = config.controller_of([nominal])
    reference = ReferenceSource(as_trajectory(plan), nominal, environment, rate)
    gates = () if isinstance(plan, Trajectory) else plan.problem.gates
    flights = DispersedFlights(draws, dispersed_fleet(nominal, draws), reference, gates)
    known = Fleet.of([nominal])
    disturbed = condition_parts(conditions, flights)
    return FlightSetup(
        start=bodies(draws.starts(reference.start)),
        parts=(
            *disturbed,
            _observer(conditions, flights, disturbed),
            *_controller(conditions, flights, known, config, controller),
            plant_part(flights.fleet, environment, rate, flights.effectiveness),
        ),
        reference=reference,
        fleet=flights.fleet,
        nominal=known,
        environment=environment,
        config=config,
        controller=controller,
        is_batch=config.flights is not None,
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


def _controller(
    conditions: Dispersion,
    flights: DispersedFlights,
    known: Fleet,
    config: FlightConfig,
    settings: Controller,
) -> tuple[LoopPart, ...]:
    """Return the controller at its own period, its delay, its disturbance observer and its inner loop.

    The controller's reference is that of the time when its commands take effect.
    """
    nominal, rate = flights.reference.vehicle, flights.reference.rate
    model = controller_model(settings, (nominal,), known, flights.reference.environment)
    period = whole_ticks(rate, config.control_rate, "control_rate")
    delay = round(conditions.computation_delay * rate)
    if delay > period:
        raise SpecError(
            f"computation_delay must be at most a period of the controller, {period / rate:g} s, "
            f"got {conditions.computation_delay:g} s; lower control_rate"
        )
    observer: tuple[LoopPart, ...] = ()
    slowest = max(rotor.lag for rotor in nominal.rotors)
    if settings.disturbance_filter > 0.0 and conditions.imu is not None and slowest <= _MAX_OBSERVER_LAG:
        # a filter faster than the rotors takes errors of their modelled lag for disturbances: unstable
        times = max(settings.disturbance_filter, slowest), delay / rate
        observer = (LoopPart(DisturbanceObserver(), DisturbanceParameters(model, *times), period=period),)
    source = None
    if period > 1 or delay > 0:
        source = replace(flights.reference, every=period, delay=delay / rate).chunk
    parameters = ControllerParameters(model, delay / rate if delay else ())
    controller = LoopPart(controller_component(config.law, settings), parameters, source, period)
    takes_effect = partial(due_ticks, period, delay=delay)
    waiting = (LoopPart(ComputationDelay(), (), takes_effect),) if delay else ()
    return (*observer, controller, *waiting, *inner_loop(config.law, model))
