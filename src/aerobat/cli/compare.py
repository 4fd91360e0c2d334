"""`aerobat compare`: every planner on one problem."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from aerobat.cli.options import TaskOptions
from aerobat.cli.run_folder import run_folder
from aerobat.cli.tasks import planning_progress, read_task
from aerobat.cli.terminal import print_json
from aerobat.reporting.comparison import comparison_figure, comparison_rows, comparison_table
from aerobat.reporting.page import png
from aerobat.reporting.report_json import to_json
from aerobat.reporting.tables import show
from aerobat.studies.compare import compare as compare_planners


def compare(problem: str, options: Annotated[TaskOptions, Parameter(name="*")] = TaskOptions()) -> None:
    """Plan a maneuver with every planner and put the plans side by side.

    Prints a table of durations, ratios to the time-optimal plan, margins, proofs and tracking errors, and
    writes compare.png and compare.json to the output folder, by default out/PROBLEM-compare.

    Parameters
    ----------
    problem
        A name that `aerobat problems` lists, or a problem's TOML file.
    """
    task, vehicle = read_task(problem, options)
    with planning_progress() as progress:
        comparison = compare_planners(task, vehicle, progress=progress)
    folder = options.out or Path("out") / f"{task.name}-compare"
    rows = to_json(comparison_rows(comparison))
    with run_folder(folder) as staging:
        (staging / "compare.json").write_text(rows + "\n", encoding="utf-8")
        (staging / "compare.png").write_bytes(png(comparison_figure(comparison)))
    if options.json:
        print_json(rows)
        return
    show(comparison_table(comparison))
    print(f"\nwritten to {folder}/")
