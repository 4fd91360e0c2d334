"""Simulation: the loop of plant, sensors and controller, and the flights that it produces."""

from aerobat.simulation.config import FlightConfig as FlightConfig
from aerobat.simulation.flight import Flight as Flight
from aerobat.simulation.flight import load_flight as load_flight
from aerobat.simulation.fly import fly as fly
from aerobat.simulation.fly import prepare as prepare
from aerobat.simulation.outcome import Outcome as Outcome
