"""`aerobat feasibility`: the least that a maneuver needs, or where there is a plan over values of fields."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import prod
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter, validators

from aerobat.cli.options import OutputOptions, PlannerOptions, Workers, output, planning
from aerobat.cli.progress import Progress, showing
from aerobat.cli.runs.folder import finish_study, require_place
from aerobat.cli.runs.record import DEFAULT_TOLERANCE, FlightSettings, RunRecord
from aerobat.cli.runs.unfinished import Unfinished
from aerobat.cli.tasks import make_planner, read_task
from aerobat.errors import SpecError
from aerobat.interchange.tables import require_writable, write_table
from aerobat.reporting.feasibility.facts import requirements
from aerobat.studies.feasibility import Axis, feasibility_map, min_requirements
from aerobat.studies.feasibility.probe import TIME_LIMIT
from aerobat.studies.kept import kept_parts


@dataclass(frozen=True, kw_only=True)
class FeasibilityOptions(PlannerOptions):
    """Options of a map of what is feasible, and of a search for the least."""

    over: Annotated[tuple[str, ...], Parameter(group=planning, show_default=False)] = ()
    """A field and its values, FIRST:LAST:STEP or values between commas, as angle=0:90:10; once or twice.
    Fields have the names of files, as limits.velocity, gate.width, vehicle.mass, or speed where no other
    field ends so; angle is the tilt of a half-flip's gate."""

    least: Annotated[
        tuple[Literal["thrust-to-weight", "ceiling", "gate", "gate-height"], ...],
        Parameter(group=planning, show_default=False),
    ] = ()
    """The quantity whose least value is sought, once or more often. Default: all that the problem has, but
    gate-height, which makes slits of openings."""

    tolerance: Annotated[float, Parameter(group=planning, validator=validators.Number(gte=1e-4, lte=0.5))] = (
        DEFAULT_TOLERANCE
    )
    """The greatest distance between the least value and the refusal beside it, as a fraction of the value."""

    workers: Annotated[str | None, Workers(group=planning)] = None

    table: Annotated[Literal["csv", "parquet"], Parameter(group=output)] = "csv"
    """The form of a map's table, map.csv or map.parquet; the latter needs aerobat[parquet]."""

    def require_one(self) -> None:
        """Raise SpecError for options of a map and of a search for the least together."""
        of_least = {"--least": bool(self.least), "--tolerance": self.tolerance != DEFAULT_TOLERANCE}
        for flag, is_given in of_least.items():
            if self.over and is_given:
                raise SpecError(f"{flag} finds the least, --over maps; leave one of them out")
        if self.table != "csv" and not self.over:
            raise SpecError("--table is for a map; add --over, or leave it out")


def feasibility(problem: str, options: FeasibilityOptions = FeasibilityOptions()) -> None:
    """Find the least thrust-to-weight ratio, ceiling and gates with a plan, or map feasibility over fields.

    Without --over, the least of each quantity is found by bisection, the others as they are. The answer comes
    with its plan, certified and flown, and with what is refused beside it, and why. Less still may be
    feasible again. Writes the plans, need.json and run.toml, by default to out/PROBLEM-need. Exits with 3
    where nothing suffices.

    With --over, each cell is planned as `aerobat plan` would plan it. The cell says planned, with duration
    and the limits that bind; not flyable, where the plan's own flight is not as it should be; no plan, where
    none is found; refused at sight, where what is asked contradicts itself or the limits; or no answer.
    Writes map.csv (a row a cell), map.json, map.png and run.toml, by default to out/PROBLEM-map-FIELDS. A
    map that was interrupted or killed goes on where it stopped when the same command is given. Exits with 0
    once all cells are done, whatever they say.

    Each plan has --time-limit seconds, 30 unless given; what has none by then counts as refused.

    Parameters
    ----------
    problem
        A name that `aerobat show` lists, or a problem's TOML file.
    """
    options.require_one()
    require_writable(f"map.{options.table}")
    task, vehicle = read_task(problem, options)
    limit = getattr(options, "time_limit", None)
    record = RunRecord(
        command="map" if options.over else "need",
        problem=task,
        vehicle=vehicle,
        planner=make_planner(options, task, vehicle),
        angle=options.angle,
        flight=FlightSettings(table=options.table),
        time_limit=TIME_LIMIT if limit is None else limit,
        over=options.over,
        of=options.least or None,
        tolerance=options.tolerance,
        plugins=options.plugin_names,
    )
    require_place(record, options)
    run_study = run_map if options.over else run_need
    run_study(record, options, options.workers)


def run_map(record: RunRecord, options: OutputOptions, workers: str | None = None) -> None:
    """Make the map of a run, write it, then show it; finished cells are kept beside its folder until then."""
    axes = [Axis.parse(text) for text in record.over]
    over = {axis.name: axis.values for axis in axes}
    if len(over) < len(axes):
        raise SpecError(f"--over names {axes[0].name} twice; give another field, or drop one")
    count = prod(len(axis.values) for axis in axes)
    name = f"map.{record.flight.table}"
    unfinished = Unfinished.beside(options.out or record.folder)

    def finished(folder: Path) -> int:
        return len(kept_parts(folder, product(*(axis.values for axis in axes))))

    with unfinished.kept("cells", count, finished) as kept:
        with showing(Progress("cells", count, kept=kept)) as progress:
            found = feasibility_map(
                record.problem,
                over,
                record.vehicle,
                record.planner,
                time_limit=TIME_LIMIT if record.time_limit is None else record.time_limit,
                workers=workers,
                keep=unfinished.parts,
                progress=progress.counting("planned"),
            )
        finish_study(found, record, options, lambda staging: write_table(found.table, staging / name))


def run_need(record: RunRecord, options: OutputOptions, workers: str | None = None) -> None:
    """Find the least that a run asks for, write it with its plans, then show it."""
    with showing(Progress("plans tried")) as progress:

        def note(quantity: str, value: float, planned: bool) -> None:
            progress.step(f"{quantity} {value:.4g} {'planned' if planned else 'refused'}")

        found = min_requirements(
            record.problem,
            record.vehicle,
            record.of,
            record.planner,
            tolerance=record.tolerance,
            time_limit=TIME_LIMIT if record.time_limit is None else record.time_limit,
            workers=workers,
            progress=note,
        )

    def write_plans(staging: Path) -> None:
        for each in found:
            if each.plan is not None:
                each.plan.save(staging / f"{record.problem.name}-{each.quantity}.plan")

    finish_study(requirements(record.problem.name, record.vehicle.name, found), record, options, write_plans)
