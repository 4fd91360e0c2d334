"""`aerobat show`: what there is to plan and to fly, and files to begin one's own with."""

from __future__ import annotations

import tomllib
from dataclasses import fields
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from aerobat.cli.options import output
from aerobat.cli.runs.saved_plans import named_vehicle
from aerobat.cli.terminal import say
from aerobat.declaration import unknown_name
from aerobat.documents import in_document
from aerobat.errors import SpecError
from aerobat.interchange.robots import SUFFIXES, VehicleDescription, import_vehicle, read_robot_description
from aerobat.problem import Problem, load_problem, problem_names
from aerobat.problem.files import PROBLEMS
from aerobat.reporting.facts import Fact, Facts
from aerobat.reporting.tables import print_table, table
from aerobat.reporting.vehicles import vehicle_row
from aerobat.storage import write_whole
from aerobat.vehicle import Vehicle, load_vehicle, vehicle_names
from aerobat.vehicle.files import VEHICLES

OF_VEHICLES, OF_PROBLEMS = (
    {*(field.name for field in fields(cls)), *cls.SHORTHANDS} for cls in (Vehicle, Problem)
)  # keys of their files


def show(name: str | None = None, /, *, out: Annotated[Path | None, Parameter(group=output)] = None) -> None:
    """List the built-in problems and vehicles; describe one, or write its file to begin your own with.

    aerobat show flip-roll --out mine.toml       a built-in problem, with the reasons for its numbers
    aerobat show agile-quad --out mine.toml      a built-in vehicle, with the source of every number
    aerobat show mine.toml                       your own: a problem as it was understood; of a vehicle its
                                                 thrust, hover, spins, agility, and what looks wrong
    aerobat show iris.sdf --out iris.toml        imported from a URDF or SDF file, with what is missing

    Parameters
    ----------
    name
        A name that is listed, a problem's or a vehicle's TOML file, or a robot's URDF or SDF file.
    out
        The file to write, as it was understood; it must not be there yet.
    """
    if name is None and out is not None:
        raise SpecError("--out writes one problem or one vehicle; name it")
    if name is None:
        problems = [load_problem(each) for each in problem_names()]
        vehicles = [vehicle_row(load_vehicle(each)) for each in vehicle_names()]
        print_table(table(Facts([Fact("problems", problems, "problems")])))
        print()
        print_table(table(Facts([Fact("vehicles", vehicles, "vehicles")])))
    elif out is not None:
        text = _text(name) if _is_vehicle(name) else PROBLEMS.text(name)
        if out.exists():
            raise SpecError(f"--out {out} is there already; name a new file")
        write_whole(out, text)
    elif _is_vehicle(name):
        _show_vehicle(name)
    else:
        print(PROBLEMS.text(name), end="")


def _is_vehicle(name: str) -> bool:
    """True for a vehicle's name or file, False for a problem's. Raises SpecError for what is neither."""
    if name in vehicle_names() or name.endswith(SUFFIXES):
        return True
    try:
        table = tomllib.loads(Path(name).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        if not isinstance(error, FileNotFoundError) or name in problem_names() or name.endswith(".toml"):
            return False  # and load_problem says what is wrong, if anything is
        raise unknown_name("problem or vehicle", name, [*problem_names(), *vehicle_names()]) from None
    return len(OF_VEHICLES & table.keys()) > len(OF_PROBLEMS & table.keys())


def _show_vehicle(name: str) -> None:
    """Say what a vehicle is; of a robot that lacks something, print the file as far as it goes."""
    is_robot = name.endswith(SUFFIXES)
    if is_robot and _robot(name).missing:
        print(_text(name), end="")
    else:
        print_table(table(import_vehicle(name) if is_robot else load_vehicle(name)))


def _robot(name: str) -> VehicleDescription:
    """Return what a robot's file says of a vehicle. Raises SpecError, which names the file."""
    with in_document(Path(name), "robot"):
        return read_robot_description(name)


def _text(name: str) -> str:
    """A vehicle's file. What is missing in it, or hardly can be, is told."""
    if not name.endswith(SUFFIXES):
        named_vehicle(name)
        return VEHICLES.text(name)
    found = _robot(name)
    if found.missing:
        say(f"warning: {name} says nothing of the rotors' {', '.join(found.missing)}; add them")
    else:
        named_vehicle(name)
    return found.toml()
