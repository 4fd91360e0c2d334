"""`aerobat tune`: controller gains for a vehicle, from many flights as it would really be flown."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from aerobat.cli.failures import ExitCode
from aerobat.cli.interrupts import end_interrupts
from aerobat.cli.options import (
    FlightsOptions,
    OutputOptions,
    PlanningOptions,
    ProblemOptions,
    how_many,
    limiting,
    output,
)
from aerobat.cli.progress import Progress, showing
from aerobat.cli.tasks import plan_of, read_run
from aerobat.cli.terminal import print_json, say
from aerobat.environment import load_dispersion
from aerobat.errors import SpecError
from aerobat.reporting.plain_data import plain, to_json
from aerobat.reporting.tables import print_table, table
from aerobat.studies.tune import tune as tune_gains
from aerobat.vehicle import load_vehicle, write_vehicle


@dataclass(frozen=True, kw_only=True)
class TuningOptions(ProblemOptions, FlightsOptions, OutputOptions):
    """Options of a search for gains."""

    flights: Annotated[int, how_many(2, 100_000)] = 200
    """The number of flights of each maneuver that each set of gains is tried on, and of others that judge
    the best."""

    evaluations: Annotated[
        int, Parameter(group=limiting, validator=validators.Number(gte=1, lte=100_000))
    ] = 150
    """The number of sets of gains that may be tried."""

    time_limit: Annotated[float | None, Parameter(group=limiting, validator=validators.Number(gte=0))] = None
    """Seconds of the search; the best gains by then are judged."""

    out: Annotated[Path | None, Parameter(group=output)] = None
    """The vehicle's file to write; an earlier one is replaced. Default: out/VEHICLE-tuned.toml."""


def tune(*problems: str, options: TuningOptions = TuningOptions()) -> ExitCode:
    """Find the controller gains with which a vehicle flies maneuvers best under conditions.

    Lowers the largest position error that 95 % of flights stay within, and counts 5 cm more for each flight
    in 100 that fails. Then flies the gains found beside the vehicle's own on as many other flights; where
    they are better, with 95 % confidence, the vehicle is written with them, by default to
    out/VEHICLE-tuned.toml, and --vehicle flies by them from there. Where they are no better nothing is
    written, and it exits with 1.

    Parameters
    ----------
    problems
        One or more: names that `aerobat show` lists, problems' TOML files, or .plan files or runs'
        folders, whose plans are flown as they are.
    """
    out = options.out
    if not problems:
        raise SpecError("a problem is missing; `aerobat show` lists some")
    if out is not None:
        _require_place(out)
    conditions = load_dispersion(options.conditions)
    planning = PlanningOptions(vehicle=options.vehicle, angle=options.angle, plugins=options.plugins)
    plans = [plan_of(*read_run(problem, planning, "plan")) for problem in problems]
    with showing(Progress("sets of gains tried", options.evaluations)) as progress:
        tuning = tune_gains(
            plans,
            conditions,
            options.flights,
            options.seed,
            evaluations=options.evaluations,
            time_limit=options.time_limit,
            workers=options.workers,
            progress=lambda tried, cost: progress.tell(tried, f"cost {100 * cost:.2f} cm so far"),
        )
    out = out or Path("out") / f"{tuning.vehicle.name}-tuned.toml"
    if tuning.is_better:
        end_interrupts()
        write_vehicle(tuning.tuned_vehicle, out)
    if options.json:
        print_json(to_json(plain(tuning) | {"file": str(out) if tuning.is_better else None}))
    else:
        print_table(table(tuning))
    say(f"written to {out}" if tuning.is_better else "nothing is written")
    return ExitCode.WELL if tuning.is_better else ExitCode.NOT_WELL


def _require_place(out: Path) -> None:
    """Raise SpecError, before hours of flying, unless a vehicle's file may be written there."""
    if out.suffix != ".toml":
        raise SpecError(f"--out must be a vehicle's file, its name ending in .toml, got {out}")
    if os.path.lexists(out):
        try:
            load_vehicle(str(out))
        except SpecError:
            raise SpecError(f"--out {out} is there already, and no vehicle's file; name another") from None
