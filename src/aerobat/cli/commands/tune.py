"""`aerobat tune`: controller gains for a vehicle, from many flights as it would really be flown."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from aerobat.cli.exit_code import ExitCode
from aerobat.cli.interrupts import end_interrupts
from aerobat.cli.options import (
    PlanningOptions,
    Plugins,
    Workers,
    flying,
    how_many,
    limiting,
    output,
    planning,
)
from aerobat.cli.progress import TuningProgress, showing
from aerobat.cli.tasks import planned
from aerobat.cli.terminal import print_json, say
from aerobat.environment import load_dispersion
from aerobat.errors import SpecError
from aerobat.reporting.report_json import to_json
from aerobat.reporting.sweeps.tuning import tuning_report, tuning_table
from aerobat.reporting.tables import print_table
from aerobat.studies.tune import tune as tune_gains
from aerobat.vehicle import write_vehicle


@dataclass(frozen=True, kw_only=True)
class TuningOptions:
    """Options of a search for gains."""

    vehicle: Annotated[str | None, Parameter(group=planning)] = None
    """The vehicle whose gains are sought: a name that `aerobat vehicles` lists, or a TOML file. Default: that
    of a .plan file, else agile-quad."""

    angle: Annotated[float | None, Parameter(group=planning)] = None
    """The tilt of a half-flip's gate in degrees, -90 to 90, to the right when positive."""

    plugins: Annotated[tuple[Path, ...], Plugins(group=planning)] = ()

    conditions: Annotated[str, Parameter(group=flying)] = "lab"
    """The variation between flights, the disturbances and the sensors: none, lab, field, or a TOML file."""

    flights: Annotated[int, how_many(2, 100_000)] = 200
    """The number of flights of each maneuver that each set of gains is tried on, and of others that judge
    the best."""

    seed: Annotated[int, Parameter(group=flying, validator=validators.Number(gte=0))] = 0
    """The seed of all flights: the same seed, the same gains, unless --time-limit ends the search."""

    evaluations: Annotated[
        int, Parameter(group=limiting, validator=validators.Number(gte=1, lte=100_000))
    ] = 150
    """The number of sets of gains that may be tried."""

    time_limit: Annotated[float | None, Parameter(group=limiting, validator=validators.Number(gte=0))] = None
    """Seconds of the search; the best gains by then are judged."""

    out: Annotated[Path | None, Parameter(group=output)] = None
    """The vehicle's file to write; an earlier one is replaced. Default: out/VEHICLE-tuned.toml."""

    workers: Annotated[str | None, Workers(group=flying)] = None

    json: Annotated[bool, Parameter(group=output, negative="", show_default=False)] = False
    """Print before and after as JSON on standard output, and nothing else."""


def tune(
    *problems: str, options: Annotated[TuningOptions, Parameter(name="*")] = TuningOptions()
) -> ExitCode:
    """Find the controller gains with which a vehicle flies maneuvers best under conditions.

    Lowers the largest position error that 95 % of flights stay within, and counts 5 cm more for each flight
    in 100 that fails. Then flies the gains found beside the vehicle's own on as many other flights; where
    they are better, with 95 % confidence, the vehicle is written with them, by default to
    out/VEHICLE-tuned.toml, and --vehicle flies by them from there. Where they are no better nothing is
    written, and it exits with 1.

    Parameters
    ----------
    problems
        One or more: names that `aerobat problems` lists, problems' TOML files, or .plan files or runs'
        folders, whose plans are flown as they are.
    """
    out = options.out
    if not problems:
        raise SpecError("a problem is missing; `aerobat problems` lists some")
    if out is not None and out.suffix != ".toml":
        raise SpecError(f"--out must be a vehicle's file, its name ending in .toml, got {out}")
    conditions = load_dispersion(options.conditions)
    planning = PlanningOptions(vehicle=options.vehicle, angle=options.angle, plugins=options.plugins)
    plans = [planned(problem, planning, "plan")[0] for problem in problems]
    with showing(TuningProgress(options.evaluations)) as progress:
        tuning = tune_gains(
            plans,
            conditions,
            options.flights,
            options.seed,
            evaluations=options.evaluations,
            time_limit=options.time_limit,
            workers=options.workers,
            progress=progress.record,
        )
    out = out or Path("out") / f"{tuning.vehicle.name}-tuned.toml"
    if tuning.is_better:
        end_interrupts()
        write_vehicle(tuning.tuned_vehicle, out)
    if options.json:
        print_json(to_json(tuning_report(tuning) | {"file": str(out) if tuning.is_better else None}))
    else:
        print_table(tuning_table(tuning))
    say(f"written to {out}" if tuning.is_better else "nothing is written")
    return ExitCode.WELL if tuning.is_better else ExitCode.NOT_WELL
