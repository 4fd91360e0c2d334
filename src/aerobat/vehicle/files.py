"""Vehicles from TOML files and back; the presets are TOML files, too."""

from __future__ import annotations

from importlib.resources import files

from aerobat.declaration import PathName, to_table, validated
from aerobat.documents import Presets, write_document
from aerobat.vehicle.vehicle import Vehicle

VEHICLES = Presets(Vehicle, "vehicle", files("aerobat.vehicle") / "presets")


def vehicle_names() -> tuple[str, ...]:
    """Return the names of the vehicles that come with Aerobat."""
    return VEHICLES.names()


@validated
def load_vehicle(name_or_path: PathName) -> Vehicle:
    """Return a vehicle that comes with Aerobat, by its name, or the vehicle in a TOML file, by its path.

    Raises SpecError, in one sentence that names the file and the field, when there is no such vehicle, the
    file is malformed, or the described vehicle cannot fly.
    """
    return VEHICLES.load(name_or_path)


def as_vehicle(vehicle: Vehicle | str) -> Vehicle:
    """Return the vehicle, given itself or an argument of `load_vehicle`. Raises SpecError as that does."""
    return load_vehicle(vehicle) if isinstance(vehicle, str) else vehicle


@validated
def write_vehicle(vehicle: Vehicle | str, path: PathName) -> None:
    """Write a vehicle as TOML, whole or not at all. Raises SpecError when the file cannot be written."""
    write_document(path, to_table(as_vehicle(vehicle)))
