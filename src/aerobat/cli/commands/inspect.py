"""`aerobat inspect`: what caused a recorded flight's error."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from aerobat.cli.options import VehicleOptions, output
from aerobat.cli.runs.folder import FLIGHT, INSPECTION
from aerobat.cli.runs.saved_plans import named_vehicle, whole_plan
from aerobat.cli.terminal import print_json
from aerobat.errors import SpecError
from aerobat.interchange import read_flight_log
from aerobat.reporting.inspection import inspection_figure
from aerobat.reporting.page import png
from aerobat.reporting.plain_data import to_json
from aerobat.reporting.tables import print_table, table
from aerobat.simulation import load_flight
from aerobat.storage import write_whole
from aerobat.studies.inspection import inspect_flight


@dataclass(frozen=True, kw_only=True)
class InspectOptions(VehicleOptions):
    """Options of an inspection: what a log is held against, and where its picture goes."""

    plan: Annotated[Path | None, Parameter(group=output)] = None
    """The flight's plan, a .plan file or its folder. Default: the one beside the log."""

    figure: Annotated[Path | None, Parameter(group=output)] = None
    """The picture's .png file. Default: inspect.png in the log's folder."""


def inspect(log: Path, options: InspectOptions = InspectOptions()) -> None:
    """Say what caused a recorded flight's error: start, saturation, delay, hand-off, gains or the vehicle.

    Of a flight whose rates an inner loop held, it also names motors in another order, rates or gains other
    than set, and slow rotors. It prints each cause's part of the largest position error and what would mend
    the main one, and writes a picture of them to inspect.png in the log's folder.

    Parameters
    ----------
    log
        A folder that `aerobat fly` wrote, a flight's .npz file, or another system's log as a .csv file with
        columns t, x, y, z, qw, qx, qy, qz and f0, f1, ..., the rotors' thrusts, or u0, u1, ..., commands;
        see docs/how-to/inspect.md.
    """
    if options.figure is not None and options.figure.suffix.lower() != ".png":
        raise SpecError(f"--figure must end in .png, got {options.figure}; name another file")
    file = log / FLIGHT if os.path.isdir(log) else log
    flight = None if file.suffix.lower() == ".csv" else load_flight(file)
    plan = whole_plan(options.plan or file.parent, "give the flight's .plan file as --plan")
    vehicle = None if options.vehicle is None else named_vehicle(options.vehicle)
    if flight is None:
        flight = read_flight_log(file, plan, vehicle)
    found = inspect_flight(flight, plan, vehicle)
    picture = options.figure or file.parent / INSPECTION
    write_whole(picture, png(inspection_figure(found)))
    if options.json:
        print_json(to_json(found))
        return
    print_table(table(found))
    print(f"written to {picture}")
