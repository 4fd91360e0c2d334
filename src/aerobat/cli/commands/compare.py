"""`aerobat compare`: every planner on one problem."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from cyclopts import Parameter, validators

from aerobat.cli.options import OutputOptions, ProblemOptions, Workers, planning
from aerobat.cli.progress import PlanningProgress, showing
from aerobat.cli.runs.folder import finish_study, require_place
from aerobat.cli.runs.record import RunRecord
from aerobat.cli.tasks import read_task
from aerobat.studies.compare import compare as compare_planners

WORKERS = (
    "The number of processes that plan side by side, or a Dask scheduler as dask://HOST:PORT. By default "
    "one, where no planner slows another down."
)


@dataclass(frozen=True, kw_only=True)
class CompareOptions(ProblemOptions, OutputOptions):
    """Options of a comparison."""

    time_limit: Annotated[float | None, Parameter(group=planning, validator=validators.Number(gte=0))] = None
    """Seconds for each planner; the best plan that it finds by then is taken, and said to be that."""

    workers: Annotated[str, Workers(group=planning, help=WORKERS)] = "1"


def compare(problem: str, options: CompareOptions = CompareOptions()) -> None:
    """Plan a maneuver with every planner and put the plans side by side.

    Prints a table of durations, ratios to the time-optimal plan, margins, proofs and tracking errors, and
    writes compare.png and compare.json to the output folder, by default out/PROBLEM-compare.

    Parameters
    ----------
    problem
        A name that `aerobat show` lists, or a problem's TOML file.
    """
    task, vehicle = read_task(problem, options)
    record = RunRecord(
        command="compare",
        problem=task,
        vehicle=vehicle,
        angle=options.angle,
        time_limit=options.time_limit,
        plugins=options.plugin_names,
    )
    require_place(record, options)
    run_comparison(record, options, options.workers)


def run_comparison(record: RunRecord, options: OutputOptions, workers: str = "1") -> None:
    """Compare all planners on a run's problem, write the comparison, then show it."""
    with showing(PlanningProgress()) as progress:
        comparison = compare_planners(
            record.problem,
            record.vehicle,
            progress=progress.record,
            begin=progress.begin,
            time_limit=record.time_limit,
            workers=workers,
        )
    finish_study(comparison, record, options)
