"""Simulation: the loop of plant, sensors and controller, and the flights that it produces."""

from aerobat.simulation.config import FlightConfig
from aerobat.simulation.flight import Flight, load_flight
from aerobat.simulation.fly import fly
from aerobat.simulation.outcome import Outcome
from aerobat.simulation.prepare import prepare

__all__ = ["Flight", "FlightConfig", "Outcome", "fly", "load_flight", "prepare"]
