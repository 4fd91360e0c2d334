"""`aerobat vehicles`: what there is to fly, and files to begin one's own with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from aerobat.cli.options import output
from aerobat.cli.runs.new_file import write_new
from aerobat.cli.runs.saved_plans import named_vehicle
from aerobat.cli.terminal import say
from aerobat.documents import in_document
from aerobat.errors import SpecError
from aerobat.interchange.robots import SUFFIXES, import_vehicle, read_robot_description
from aerobat.reporting.facts import Fact, Facts
from aerobat.reporting.tables import print_table, table
from aerobat.reporting.vehicles import vehicle_row
from aerobat.vehicle import load_vehicle, vehicle_names, vehicle_text


def vehicles(
    vehicle: str | None = None, /, *, out: Annotated[Path | None, Parameter(group=output)] = None
) -> None:
    """List the built-in vehicles; say of one what it is and what looks wrong, or write its file.

    aerobat vehicles agile-quad --out mine.toml      a built-in one, with the source of every number
    aerobat vehicles mine.toml                       your own: its thrust, hover, spins, agility, and doubts
    aerobat vehicles iris.sdf --out iris.toml        imported from a URDF or SDF file, with what is missing

    Parameters
    ----------
    vehicle
        A name that is listed, a vehicle's TOML file, or a robot's URDF or SDF file.
    out
        The file to write, as it was understood; it must not be there yet.
    """
    if vehicle is not None and out is not None:
        write_new(_text(vehicle), out)
    elif vehicle is not None:
        _show(vehicle)
    elif out is not None:
        raise SpecError("--out writes one vehicle; name it")
    else:
        rows = [vehicle_row(load_vehicle(name)) for name in vehicle_names()]
        print_table(table(Facts([Fact("vehicles", rows, "vehicles")])))


def _show(name: str) -> None:
    """Say what a vehicle is; of a robot that lacks something, print the file as far as it goes."""
    if name.endswith(SUFFIXES):
        with in_document(Path(name), "robot"):
            found = read_robot_description(name)
        if found.missing:
            print(_text(name), end="")
            return
        vehicle = import_vehicle(name)
    else:
        vehicle = load_vehicle(name)
    print_table(table(vehicle))


def _text(name: str) -> str:
    """A vehicle's file. What is missing in it, or hardly can be, is told."""
    if not name.endswith(SUFFIXES):
        named_vehicle(name)
        return vehicle_text(name)
    with in_document(Path(name), "robot"):
        found = read_robot_description(name)
    if found.missing:
        say(f"warning: {name} says nothing of the rotors' {', '.join(found.missing)}; add them")
    else:
        named_vehicle(name)
    return found.toml()
