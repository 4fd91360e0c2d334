"""A run's folder: everything that one command made, put in place as one."""

from __future__ import annotations

from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING

from aerobat.cli.options import PlanningOptions
from aerobat.storage import whole_folder

if TYPE_CHECKING:
    from aerobat.evaluation.score import Score
    from aerobat.planning import Plan
    from aerobat.simulation import Flight
    from aerobat.vehicle import Vehicle

FILES = ("plan.npz", "plan.csv", "flight.npz", "report.json", "report.png", "compare.json", "compare.png")


def run_folder(folder: Path) -> AbstractContextManager[Path]:
    """Yield an empty folder that replaces that of an earlier run as one; see `whole_folder`."""
    return whole_folder(folder, FILES.__contains__)


def finish(
    plan: Plan,
    vehicle: Vehicle,
    options: PlanningOptions,
    flight: Flight | None = None,
    score: Score | None = None,
) -> None:
    """Write what was made, then say what it is."""
    from aerobat.interchange.csv import write_csv
    from aerobat.reporting.figures import report_figure
    from aerobat.reporting.page import png
    from aerobat.reporting.report_json import report, to_json
    from aerobat.reporting.tables import show, summary_table
    from aerobat.trajectory import save_trajectory

    folder = options.out or Path("out") / plan.problem.name
    facts = to_json(report(plan, score, vehicle.name))
    with run_folder(folder) as staging:
        save_trajectory(plan.trajectory, staging / "plan.npz")
        write_csv(plan.trajectory, staging / "plan.csv")
        if flight is not None:
            flight.save(staging / "flight.npz")
        (staging / "report.json").write_text(facts + "\n", encoding="utf-8")
        (staging / "report.png").write_bytes(png(report_figure(plan, vehicle, flight, score)))
    if options.json:
        print(facts)
        return
    show(summary_table(plan, score, vehicle.name))
    print(f"\nwritten to {folder}/")
