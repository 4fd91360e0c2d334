"""Vehicles, their rotors, and the effect of the rotors on the body."""

from aerobat.vehicle.allocation import mixer as mixer
from aerobat.vehicle.allocation import rotor_thrusts as rotor_thrusts
from aerobat.vehicle.allocation import wrench as wrench
from aerobat.vehicle.ellipsoid import Ellipsoid as Ellipsoid
from aerobat.vehicle.files import as_vehicle as as_vehicle
from aerobat.vehicle.files import load_vehicle as load_vehicle
from aerobat.vehicle.files import vehicle_names as vehicle_names
from aerobat.vehicle.files import write_vehicle as write_vehicle
from aerobat.vehicle.plausibility import implausibilities as implausibilities
from aerobat.vehicle.rotor import Rotor as Rotor
from aerobat.vehicle.vehicle import Vehicle as Vehicle
