"""Flights under conditions, put together by hand: the controller sees the truth, sensors look on."""

from dataclasses import replace
from typing import Any

from aerobat.control.parameters import airframe_parameters
from aerobat.engines.pytree import Tree
from aerobat.environment import Dispersion
from aerobat.problem import Problem
from aerobat.simulation import FlightConfig, prepare
from aerobat.simulation.conditions.draw import Draws, dispersed_fleet
from aerobat.simulation.conditions.parts import DispersedFlights, condition_parts
from aerobat.simulation.setup import FlightSetup
from aerobat.vehicle import Vehicle

RATE = 1000.0  # [1/s]


def drawn(dispersion: Dispersion, vehicle: Vehicle, flights: int, seed: int = 7) -> Draws:
    return Draws(dispersion, len(vehicle.rotors), seed, range(flights))


def dispersed_setup(
    plan: Any,
    vehicle: Vehicle,
    dispersion: Dispersion,
    draws: Draws,
    *,
    problem: Problem | None = None,
    engine: str = "compiled",
) -> FlightSetup:
    """The flights of some draws, with the components of their conditions before the others."""
    config = FlightConfig(rate=RATE, engine=engine, nominal=vehicle)
    setup = prepare(plan, [vehicle] * len(draws), config=config)
    fleet = dispersed_fleet(vehicle, draws)
    gates = () if problem is None else problem.gates
    flights = DispersedFlights(draws, fleet, setup.reference, gates)
    observer, controller, plant = setup.parts
    actual = plant.parameters._replace(airframe=airframe_parameters(fleet, flights.effectiveness))
    parts = (*condition_parts(dispersion, flights), observer, controller, replace(plant, parameters=actual))
    return replace(setup, parts=parts, fleet=fleet)


def rows_of(setup: FlightSetup, log: Any, ticks: int | None = None) -> Tree:
    """What a log keeps of every tick, leaves (vehicles, ticks)."""
    loop = setup.compile(log=log)
    return loop.scan(loop.init(setup.first_tick), setup.inputs(0, ticks or len(setup.times)))[1]
