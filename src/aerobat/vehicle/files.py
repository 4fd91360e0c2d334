"""Vehicles from TOML files; the presets are such files too.

A file holds mass, inertia (three principal moments or a 3 x 3 matrix), optionally name, description,
and drag_body, and one [[rotors]] table a rotor with position_body and spin; what the rotors share
stands once in [rotor_defaults]. Units are SI, the keys are those of Vehicle and Rotor.
"""

from __future__ import annotations

import os
from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np

from aerobat.documents import document_names, in_document, read_document, resolve_document, within
from aerobat.errors import SpecError
from aerobat.vehicle.vehicle import Rotor, Vehicle

if TYPE_CHECKING:
    from aerobat.vehicle.schema import RotorDefaults, RotorTable, VehicleTable

PRESETS = files("aerobat.vehicle") / "presets"


def vehicle_names() -> tuple[str, ...]:
    """The names of the vehicles that come with Aerobat."""
    return document_names(PRESETS)


def load_vehicle(name_or_path: str | os.PathLike[str]) -> Vehicle:
    """A vehicle that comes with Aerobat, by its name, or the one in a TOML file, by its path.

    Raises SpecError, in one sentence that names the file and the field, when there is no such vehicle, the
    file is malformed, or what it describes cannot fly.
    """
    from aerobat.vehicle.schema import VehicleTable

    path = resolve_document(name_or_path, PRESETS, "vehicle")
    table = read_document(path, VehicleTable, "vehicle")
    with in_document(path, "vehicle"):
        return _vehicle(table, default_name=path.name.removesuffix(".toml"))


def _vehicle(table: VehicleTable, default_name: str) -> Vehicle:
    inertia = np.array(table.inertia)
    return Vehicle(
        name=default_name if table.name is None else table.name,
        mass=table.mass,
        inertia=np.diag(inertia) if inertia.ndim == 1 else inertia,
        rotors=tuple(_rotor(rotor, i, table.rotor_defaults) for i, rotor in enumerate(table.rotors)),
        drag_body=np.array(table.drag_body),
        description=table.description,
    )


def _rotor(table: RotorTable, index: int, defaults: RotorDefaults) -> Rotor:
    given = defaults.model_dump(exclude_none=True) | table.model_dump(exclude_none=True)
    with within(f"rotors[{index}]."):
        for name in type(defaults).model_fields:
            if name not in given:
                raise SpecError(f"{name} is missing; add it there or, for all rotors, in [rotor_defaults]")
        return Rotor(**given)
