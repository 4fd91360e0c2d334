"""`aerobat need`: the least thrust-to-weight ratio, the lowest ceiling, the smallest gates."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from aerobat.cli.feasibility_options import NeedOptions
from aerobat.cli.options import OutputOptions
from aerobat.cli.progress import NeedProgress, showing
from aerobat.cli.runs.folder import is_of_a_run, written
from aerobat.cli.runs.record import RunRecord
from aerobat.cli.tasks import make_planner, read_task
from aerobat.reporting.feasibility.table import requirements_report, requirements_table
from aerobat.reporting.report_json import to_json
from aerobat.storage import require_replaceable
from aerobat.studies.feasibility import Requirement, min_requirements
from aerobat.studies.feasibility.probe import TIME_LIMIT

NEED = "need.json"


def need(problem: str, options: Annotated[NeedOptions, Parameter(name="*")] = NeedOptions()) -> None:
    """Find the least thrust-to-weight ratio, the lowest ceiling and the smallest gates with a plan.

    Each by bisection, the others as they are: the answer comes with its plan, certified and flown, and with
    what is refused beside it, and why. Less still may be feasible again. Each plan has --time-limit seconds,
    30 unless given; what has none by then counts as refused. Writes the plans, need.json and run.toml to the
    output folder, by default out/PROBLEM-need. Exits with 3 where nothing suffices.

    Parameters
    ----------
    problem
        A name that `aerobat problems` lists, or a problem's TOML file.
    """
    task, vehicle = read_task(problem, options)
    limit = getattr(options, "time_limit", None)
    record = RunRecord(
        command="need",
        problem=task,
        vehicle=vehicle,
        planner=make_planner(options, task, vehicle),
        angle=options.angle,
        time_limit=TIME_LIMIT if limit is None else limit,
        of=options.of or None,
        tolerance=options.tolerance,
        plugins=tuple(map(str, options.plugins)),
    )
    require_replaceable(options.out or record.folder, is_of_a_run)  # before minutes of planning
    finish_need(need_of(record, options.workers), record, options)


def need_of(record: RunRecord, workers: str | None = None) -> tuple[Requirement, ...]:
    """The answers of a run, made anew.

    Args:
        record: What is planned, and how.
        workers: Who plans.
    """
    with showing(NeedProgress()) as progress:
        return min_requirements(
            record.problem,
            record.vehicle,
            record.of,
            record.planner,
            tolerance=record.tolerance,
            time_limit=TIME_LIMIT if record.time_limit is None else record.time_limit,
            workers=workers,
            progress=progress.record,
        )


def finish_need(found: Sequence[Requirement], record: RunRecord, options: OutputOptions) -> None:
    """Write what is needed, then show it."""
    names = record.problem.name, record.vehicle.name
    facts = to_json(requirements_report(*names, found))

    def write(staging: Path) -> None:
        (staging / NEED).write_text(facts + "\n", encoding="utf-8")
        for each in found:
            if each.plan is not None:
                each.plan.save(staging / f"{record.problem.name}-{each.quantity}.plan")

    written(record, options, write, facts, requirements_table(*names, found))
