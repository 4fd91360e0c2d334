"""`aerobat map`: where there is a plan, over values of two fields, and which limits bind."""

from __future__ import annotations

from math import prod
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from aerobat.cli.feasibility_options import MapOptions
from aerobat.cli.options import OutputOptions
from aerobat.cli.progress import MapProgress, showing
from aerobat.cli.runs.folder import is_of_a_run, written
from aerobat.cli.runs.record import FlightSettings, RunRecord
from aerobat.cli.tasks import make_planner, read_task
from aerobat.errors import SpecError
from aerobat.interchange.tables import require_writable, write_table
from aerobat.reporting.feasibility.figure import map_figure
from aerobat.reporting.feasibility.table import map_report, map_table
from aerobat.reporting.page import png
from aerobat.reporting.report_json import to_json
from aerobat.storage import require_replaceable
from aerobat.studies.feasibility import Axis, FeasibilityMap, feasibility_map
from aerobat.studies.feasibility.probe import TIME_LIMIT


def map(problem: str, options: Annotated[MapOptions, Parameter(name="*")] = MapOptions()) -> None:
    """Plan a maneuver over values of two fields, and say where there is a plan and which limits bind.

    Each cell is planned as `aerobat plan` would plan it, and says planned, with duration and the limits that
    bind; not flyable, where the plan's own flight is not as it should be; no plan, where none is found;
    refused at sight, where what is asked contradicts itself or the limits; or no answer in --time-limit
    seconds, 30 unless given. Writes map.csv (a row a cell), map.json, map.png and run.toml to the output
    folder, by default out/PROBLEM-map-FIELDS. Exits with 0 once all cells are done, whatever they say.

    Parameters
    ----------
    problem
        A name that `aerobat problems` lists, or a problem's TOML file.
    """
    if not options.over:
        raise SpecError("--over is missing; give a field and its values, as --over speed=2:20:2")
    require_writable(f"map.{options.table}")
    task, vehicle = read_task(problem, options)
    limit = getattr(options, "time_limit", None)
    record = RunRecord(
        command="map",
        problem=task,
        vehicle=vehicle,
        planner=make_planner(options, task, vehicle),
        angle=options.angle,
        flight=FlightSettings(table=options.table),
        time_limit=TIME_LIMIT if limit is None else limit,
        over=options.over,
        plugins=tuple(str(path) for path in options.plugins),
    )
    require_replaceable(options.out or record.folder, is_of_a_run)  # before minutes of planning
    finish_map(map_of(record, options.workers), record, options)


def map_of(record: RunRecord, workers: str | None = None) -> FeasibilityMap:
    """The map of a run, made anew.

    Args:
        record: What is planned, and how.
        workers: Who plans.
    """
    axes = [Axis.parse(text) for text in record.over]
    over = {axis.name: axis.values for axis in axes}
    if len(over) < len(axes):
        raise SpecError(f"--over names {axes[0].name} twice; give another field, or drop one")
    with showing(MapProgress(prod(len(axis.values) for axis in axes))) as progress:
        return feasibility_map(
            record.problem,
            over,
            record.vehicle,
            record.planner,
            time_limit=TIME_LIMIT if record.time_limit is None else record.time_limit,
            workers=workers,
            progress=progress.record,
        )


def finish_map(found: FeasibilityMap, record: RunRecord, options: OutputOptions) -> None:
    """Write a map, then show it."""
    facts = to_json(map_report(found))
    picture = png(map_figure(found))

    def write(staging: Path) -> None:
        write_table(found.table, staging / f"map.{record.flight.table}")
        (staging / "map.json").write_text(facts + "\n", encoding="utf-8")
        (staging / "map.png").write_bytes(picture)

    written(record, options, write, facts, map_table(found))
