"""A run's folder: all files that a command made, put in place together."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Group

from aerobat.cli.failures import ExitCode
from aerobat.cli.interrupts import end_interrupts
from aerobat.cli.options import USUAL_CONDITIONS, OutputOptions
from aerobat.cli.progress import Progress, showing
from aerobat.cli.runs.record import RECORD, FlightSettings, RunRecord, write_record
from aerobat.cli.terminal import print_json
from aerobat.control import named_controller
from aerobat.environment import dispersion_names, load_dispersion
from aerobat.errors import SpecError
from aerobat.evaluation import Score
from aerobat.interchange.columns import write_columns
from aerobat.planning import Plan
from aerobat.reporting.facts import EXPLAIN, REPORT, picture
from aerobat.reporting.figures import report_figure
from aerobat.reporting.page import import_undocumented, png
from aerobat.reporting.plain_data import to_json
from aerobat.reporting.report import Report
from aerobat.reporting.tables import print_table, table
from aerobat.simulation import Flight
from aerobat.storage import require_replaceable, whole_folder
from aerobat.studies.share import Share, Trials

FLIGHT = "flight.npz"
CALM = "none"  # the conditions under which nothing varies, so that no flights are counted
AUTOPILOT = "autopilot.txt"  # the settings of the firmware of the autopilot
BLACKBOX = "blackbox.bfl"  # the firmware's log of the flight
INSPECTION = "inspect.png"  # added later, by `aerobat inspect`
REPLAY = "replay.html"  # added later, by `aerobat view`
FILES = (
    RECORD,
    FLIGHT,
    AUTOPILOT,
    BLACKBOX,
    REPLAY,
    INSPECTION,
    "plan.npz",
    "plan.csv",
    *(f"{name}.{kind}" for name in ("report", "compare", "sweep", "map") for kind in ("json", "png")),
    *(f"{name}.{kind}" for name in ("flights", "map") for kind in ("csv", "parquet")),
    "need.json",
)


def is_of_a_run(name: str) -> bool:
    """Return True for the name of a file that runs write."""
    return name in FILES or name.endswith(".plan")


def require_place(record: RunRecord, options: OutputOptions) -> None:
    """Raise SpecError, before anything is planned or flown, for a folder that holds what no run wrote."""
    require_replaceable(options.out or record.folder, is_of_a_run)


def written(
    record: RunRecord,
    options: OutputOptions,
    write: Callable[[Path], None],
    facts: str,
    *tables: Group,
    hint: str = "",
) -> None:
    """Write a run to its folder as a whole, in place of an earlier run there, then print its report.

    Ctrl-C discards the run until the folder is in its place, and is ignored afterwards.

    Args:
        record: The record of the run.
        options: Options of the place of results, and of JSON.
        write: Writes all files but the record to a folder.
        facts: The report as JSON.
        tables: The report as tables.
        hint: A hint to further commands.
    """
    folder = options.out or record.folder
    replaced = os.path.isdir(folder) and any(folder.iterdir())  # False for names that no folder can have
    with whole_folder(folder, is_of_a_run) as staging:
        write(staging)
        write_record(record, staging)
        end_interrupts()
    if options.json:
        print_json(facts)
        return
    for each in tables:
        print_table(each)
    print(f"\n{hint}written to {folder}/" + (", in the place of an earlier run" if replaced else ""))


def finish_study(
    result: Any, record: RunRecord, options: OutputOptions, write_others: Callable[[Path], None] | None = None
) -> None:
    """Write a study's facts and its picture, if it has one, as COMMAND.json and COMMAND.png, then print it.

    Args:
        result: The result of the study.
        record: The record of the run.
        options: Options of the place of results, and of JSON.
        write_others: Writes further files to a folder.
    """
    facts, figure = to_json(result), picture(result)
    pixels = None if figure is None else png(figure)

    def write(staging: Path) -> None:
        (staging / f"{record.command}.json").write_text(facts + "\n", encoding="utf-8")
        if pixels is not None:
            (staging / f"{record.command}.png").write_bytes(pixels)
        if write_others is not None:
            write_others(staging)

    written(record, options, write, facts, table(result))


@dataclass(frozen=True)
class Flown:
    """A plan's flight, its score, and the names of the controller and the simulator."""

    flight: Flight
    score: Score
    controller: str
    plant: str | None  # the name of another simulator
    settings: str = ""  # of an autopilot's firmware, for its command line
    own_log: bytes = b""  # of an autopilot's firmware

    def write(self, folder: Path) -> None:
        """Write the flight to a folder, with the settings and the log of an autopilot's firmware, if any."""
        self.flight.save(folder / FLIGHT)
        if self.settings:
            (folder / AUTOPILOT).write_text(self.settings, encoding="utf-8")
        if self.own_log:
            (folder / BLACKBOX).write_bytes(self.own_log)


def finish(
    plan: Plan, record: RunRecord, options: OutputOptions, flown: Flown | None = None, explain: bool = False
) -> ExitCode:
    """Write a plan, with its flight if it was flown, then print the report; return the exit code.

    Args:
        plan: The plan.
        record: The record of the run.
        options: Options of the place of results, and of JSON.
        flown: The plan's flight, if it was flown.
        explain: Whether to report all facts, and to count flights of a plan that was not flown.
    """
    assert plan.vehicle is not None, "a command plans for a vehicle"
    flight, score = (flown.flight, flown.score) if flown else (None, None)
    controller, plant = (flown.controller, flown.plant) if flown else (None, None)
    trials = trial_flights(plan, record) if flown or explain else None
    report = Report(plan, score, controller, plant, trials)
    facts = to_json(report)
    import_undocumented()
    pixels = png(report_figure(plan, plan.vehicle, flight, score))

    def write(staging: Path) -> None:
        plan.save(staging / f"{plan.problem.name}.plan")
        write_columns(plan, staging / "plan.csv", record.columns)
        if flown is not None:
            flown.write(staging)
        (staging / "report.json").write_text(facts + "\n", encoding="utf-8")
        (staging / "report.png").write_bytes(pixels)

    tables = [table(report, most=REPORT)]
    if explain:
        tables.append(table(report, least=EXPLAIN, title=f"{plan.problem.name} · all facts"))
    hint = "" if explain else f"--explain tells more{_sweep_hint(record, options.out or record.folder)}\n"
    written(record, options, write, facts, *tables, hint=hint)
    return ExitCode.WELL if report.is_well else ExitCode.NOT_WELL


def _sweep_hint(record: RunRecord, folder: Path) -> str:
    """Return the command that counts more flights; empty where a sweep has no options for these flights."""
    flight = record.flight
    conditions = None if flight.conditions is None else flight.conditions.name
    is_own = conditions is not None and conditions not in dispersion_names()  # of an unknown file
    if flight.plant is not None or flight.autopilot is not None or is_own:
        return ""
    options = [f" --import {file}" for file in record.plugins]
    if flight.controller != FlightSettings().controller:
        options.append(f" --controller {flight.controller}")
    if conditions not in (None, CALM):
        options.append(f" --conditions {conditions}")
    return f"; `aerobat sweep {folder}{''.join(options)}` counts more flights"


def trial_flights(plan: Plan, record: RunRecord) -> Trials | None:
    """Return the outcomes of many flights of a plan under the run's conditions, by default lab.

    For a plan made with --pass, these are the flights that proved it. None is returned where nothing varies,
    for the paper's plans, which leave no reserve to the controller, for another simulator, which takes
    minutes, and for a vehicle that cannot hover.

    Args:
        plan: The plan, for a vehicle.
        record: The run, of which the controller and the seed are used.
    """
    from aerobat.studies.flights import FlightTask, fly_trials  # slow to import, and needed only here

    assert plan.vehicle is not None, "a command plans for a vehicle"
    flight = record.flight
    if flight.conditions is None and record.paper:
        return None
    conditions = load_dispersion(USUAL_CONDITIONS) if flight.conditions is None else flight.conditions
    if flight.plant is not None or conditions == load_dispersion(CALM):
        return None
    if flight.probability is not None and plan.tube is not None:
        return Trials(conditions, flight.seed, Share(plan.tube.passed, plan.tube.flights))
    try:
        plan.vehicle.require_hover(plan.problem.environment.gravity)
    except SpecError:
        return None
    controller = named_controller(flight.controller, plan.vehicle.controller)
    with showing(Progress("flown")) as progress:
        task = FlightTask(plan, plan.vehicle, conditions, flight.seed, controller)
        return fly_trials(task, progress.counting("went well"))
