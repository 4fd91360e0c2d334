"""`aerobat sweep`: many flights of one plan, as it would really be flown."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from aerobat.cli.options import FlightsOptions, OutputOptions, PlanningOptions, flying, output
from aerobat.cli.progress import Progress, showing
from aerobat.cli.runs.folder import finish_study, require_place
from aerobat.cli.runs.record import RECORD, FlightSettings, RunRecord, read_record, write_record
from aerobat.cli.runs.unfinished import PLAN, Unfinished
from aerobat.cli.tasks import plan_of, read_run
from aerobat.control import named_controller
from aerobat.environment import load_dispersion
from aerobat.errors import SpecError
from aerobat.interchange.tables import require_writable, write_table
from aerobat.planning import Plan, load_plan
from aerobat.studies.flights import cut
from aerobat.studies.kept import kept_parts
from aerobat.studies.sweep.sweep import sweep as sweep_plan


def _plan_kept(folder: Path, record: RunRecord) -> Plan:
    """The plan that the folder of the unfinished sweep keeps, or a new one, which is kept there.

    Raises SpecError where the flights there are those of another sweep.
    """
    if all(os.path.exists(folder / name) for name in (RECORD, PLAN)):
        if _without_runs(read_record(folder)) != _without_runs(record):
            raise SpecError(
                f"{folder}/ keeps the flights of an unfinished sweep with other settings; repeat "
                "those to finish it, remove it, or give another --out"
            )
        return load_plan(folder / PLAN)
    found = plan_of(record)
    found.save(folder / PLAN)
    write_record(record, folder)
    return found


def _without_runs(record: RunRecord) -> RunRecord:
    """The record without what changes no flight."""
    flight = replace(record.flight, runs=1, table="csv")
    return replace(record, flight=flight, versions={})


@dataclass(frozen=True, kw_only=True)
class SweepingOptions(FlightsOptions):
    """Options of a sweep."""

    controller: Annotated[str, Parameter(group=flying)] = "full"
    """The control law: full, or paper, at the gains of the vehicle's file; lee, lqr, indi, rates; or one of
    your own that --import brings in."""

    table: Annotated[Literal["csv", "parquet"], Parameter(group=output)] = "csv"
    """The form of the table, flights.csv or flights.parquet; the latter needs aerobat[parquet]."""


def sweep(
    problem: str,
    options: PlanningOptions = PlanningOptions(),
    sweeping: SweepingOptions = SweepingOptions(),
) -> None:
    """Fly a maneuver many times as it would really be flown, and count what becomes of it.

    Each flight draws its own vehicle, start, sensor errors, wind and battery. Prints shares of outcomes with
    95 % confidence and quantiles of errors, and writes to the output folder, by default
    out/PROBLEM-sweep-CONDITIONS: flights.csv (a row a flight), sweep.json, sweep.png, PROBLEM.plan and
    run.toml. A sweep that was interrupted or killed goes on where it stopped when the same command is given.
    Exits with 0 once all is flown, whatever became of the flights.

    Parameters
    ----------
    problem
        A name that `aerobat show` lists, a problem's TOML file, or a .plan file, a CSV file or a run's
        folder, whose plan is flown as it is.
    """
    named_controller(sweeping.controller)  # refused before anything is planned
    settings = FlightSettings(
        controller=sweeping.controller,
        conditions=load_dispersion(sweeping.conditions),
        seed=sweeping.seed,
        runs=sweeping.flights,
        table=sweeping.table,
    )
    require_writable(f"flights.{settings.table}")
    record, plan = read_run(problem, options, "sweep", settings)
    require_place(record, options)
    if plan is None:
        plan = _plan_kept(Unfinished.beside(options.out or record.folder).folder, record)
    run_sweep(plan, record, options, sweeping.workers)


def run_sweep(plan: Plan, record: RunRecord, options: OutputOptions, workers: str | None = None) -> None:
    """Fly a sweep, write it with its plan and its table, then show it.

    Finished flights are kept beside the run's folder until that is written.

    Args:
        plan: What is flown.
        record: How.
        options: Where to write, and in what form to say it.
        workers: Who flies it.
    """
    flight = record.flight
    assert flight.conditions is not None, "a sweep has conditions"
    unfinished = Unfinished.beside(options.out or record.folder)

    def finished(folder: Path) -> int:
        return sum(map(len, kept_parts(folder, cut(range(flight.runs)))))

    with unfinished.kept("flights", flight.runs, finished) as kept:
        with showing(Progress("flown", flight.runs, kept=kept)) as progress:
            swept = sweep_plan(
                plan,
                flight.conditions,
                flight.runs,
                flight.seed,
                vehicle=record.vehicle,
                controller=named_controller(flight.controller, record.vehicle.controller),
                workers=workers,
                keep=unfinished.parts,
                progress=progress.counting("went well"),
            )

        def write_others(staging: Path) -> None:
            swept.plan.save(staging / f"{swept.plan.problem.name}.plan")
            write_table(swept.table, staging / f"flights.{flight.table}")

        finish_study(swept, record, options, write_others)
