"""Vehicles, their rotors, and the effect of the rotors on the body."""

from aerobat.vehicle.allocation import mixer, rotor_thrusts, wrench
from aerobat.vehicle.ellipsoid import Ellipsoid
from aerobat.vehicle.files import as_vehicle, load_vehicle, vehicle_names, vehicle_text, write_vehicle
from aerobat.vehicle.plausibility import implausibilities
from aerobat.vehicle.rotor import Rotor
from aerobat.vehicle.vehicle import Vehicle

__all__ = [
    "Ellipsoid",
    "Rotor",
    "Vehicle",
    "as_vehicle",
    "implausibilities",
    "load_vehicle",
    "mixer",
    "rotor_thrusts",
    "vehicle_names",
    "vehicle_text",
    "wrench",
    "write_vehicle",
]
