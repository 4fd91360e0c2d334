"""`aerobat repeat`: a run again from its folder, compared with what lies there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from numpy.typing import NDArray

from aerobat.cli.commands.compare import COMPARISON, comparison_of, finish_comparison
from aerobat.cli.commands.feasibility import NEED, finish_map, finish_need, map_of, need_of
from aerobat.cli.commands.fly import flown
from aerobat.cli.commands.sweep import finish_sweep, sweep_of, table_name
from aerobat.cli.failures import ExitCode
from aerobat.cli.options import ExplainingOptions, OutputOptions, output
from aerobat.cli.runs.folder import FLIGHT, finish
from aerobat.cli.runs.record import RunRecord, read_record, versions_now
from aerobat.cli.tasks import plan_of
from aerobat.cli.terminal import say
from aerobat.documents import read_json
from aerobat.errors import SpecError
from aerobat.interchange import read_plan, read_table
from aerobat.planning import Plan, with_explanation
from aerobat.reporting.feasibility.facts import requirements
from aerobat.reporting.plain_data import plain
from aerobat.simulation import Flight, load_flight

SAME = ("planner", "duration_s")  # of a comparison's rows: times of the clock are not


@dataclass(frozen=True, kw_only=True)
class RepeatOptions(OutputOptions, ExplainingOptions):
    """Options of a run that is repeated."""

    out: Annotated[Path | None, Parameter(group=output)] = None
    """The folder to write to, replaced as a whole. Default: FOLDER-repeated, beside the one repeated."""


def repeat(
    folder: Path, options: Annotated[RepeatOptions, Parameter(name="*")] = RepeatOptions()
) -> ExitCode:
    """Do a run again from its folder, and say if it came to the same.

    Takes problem, vehicle, planner, options and seed from the run.toml there, plans and flies anew, and
    writes to FOLDER-repeated unless --out says otherwise. With the same versions of the libraries the plan
    and the flight are the same, bit for bit; a run that ended by --time-limit need not be. Exits with 0 only
    if they are, and all is well.

    Parameters
    ----------
    folder
        A folder that `aerobat plan`, `fly`, `sweep`, `feasibility` or `compare` wrote.
    """
    record = read_record(folder)
    out = options.out or folder.with_name(f"{folder.resolve().name}-repeated")
    options = replace(options, out=out)
    if record.command == "compare":
        return _repeat_comparison(folder, record, options)
    if record.command == "sweep":
        return _repeat_sweep(folder, record, options)
    if record.command == "map":
        return _repeat_map(folder, record, options)
    if record.command == "need":
        return _repeat_need(folder, record, options)
    old = _Run.read(folder, record)
    if record.planner is not None:
        plan = plan_of(record, options.explain)
    else:
        plan = with_explanation(old.plan) if options.explain else old.plan
    again = flown(plan, record.flight) if record.command == "fly" else None
    code = finish(plan, record, options, again, options.explain)
    return _told(folder, record, old.difference(_Run(plan, again.flight if again else None)), code)


def _repeat_comparison(folder: Path, record: RunRecord, options: RepeatOptions) -> ExitCode:
    try:
        old = [[row[name] for name in SAME] for row in read_json(folder / COMPARISON)["planners"]]
    except (SpecError, TypeError, KeyError):
        raise SpecError(f"{folder}/ has no {COMPARISON} that can be read; compare anew") from None
    comparison = comparison_of(record)
    rows = [[row[name] for name in SAME] for row in plain(comparison)["planners"]]
    finish_comparison(comparison, record, options)
    return _told(folder, record, "" if rows == old else "durations are others", ExitCode.WELL)


def _repeat_sweep(folder: Path, record: RunRecord, options: RepeatOptions) -> ExitCode:
    old = read_table(folder / table_name(record.flight))
    plan = _Run.read(folder, record).plan if record.planner is None else plan_of(record)
    swept = sweep_of(plan, record, options)
    names = [name for name, column in swept.table.items() if not _same(column, old.get(name, np.zeros(0)))]
    finish_sweep(swept, record, options)
    return _told(folder, record, f"flights differ in {', '.join(names)}" if names else "", ExitCode.WELL)


def _repeat_map(folder: Path, record: RunRecord, options: RepeatOptions) -> ExitCode:
    old = read_table(folder / f"map.{record.flight.table}")
    found = map_of(record)
    names = [name for name, column in found.table.items() if not _same(column, old.get(name, np.zeros(0)))]
    finish_map(found, record, options)
    return _told(folder, record, f"cells differ in {', '.join(names)}" if names else "", ExitCode.WELL)


def _repeat_need(folder: Path, record: RunRecord, options: RepeatOptions) -> ExitCode:
    try:
        old = read_json(folder / NEED)
    except SpecError:
        raise SpecError(f"{folder}/ has no {NEED} that can be read; search anew") from None
    found = need_of(record)
    finish_need(found, record, options)
    again = plain(requirements(record.problem.name, record.vehicle.name, found))
    difference = "" if again == old else "what is needed is another"
    return _told(folder, record, difference, ExitCode.WELL)


def _told(folder: Path, record: RunRecord, difference: str, code: ExitCode) -> ExitCode:
    """Say on standard error how a repeated run compares; one that differs is not well."""
    if not difference:
        say(f"the same as in {folder}/, bit for bit")
        return code
    now = versions_now()
    changed = [name for name in {*now, *record.versions} if now.get(name) != record.versions.get(name)]
    versions = f" (other versions of {', '.join(sorted(changed))})" if changed else ""
    say(f"not the same as in {folder}/: {difference}{versions}")
    return ExitCode.NOT_WELL


@dataclass(frozen=True)
class _Run:
    """What a run came to."""

    plan: Plan
    flight: Flight | None

    @classmethod
    def read(cls, folder: Path, record: RunRecord) -> _Run:
        """Read a run from its folder."""
        plan = read_plan(folder)
        if not isinstance(plan, Plan):
            raise SpecError(f"{folder}/ holds no .plan file; run anew")
        return cls(plan, load_flight(folder / FLIGHT) if record.command == "fly" else None)

    def difference(self, other: _Run) -> str:
        """Return how another run differs, in words; nothing where it does not."""
        own, its = self.plan.trajectory, other.plan.trajectory
        if not _same(own.durations, its.durations) or not _same(own.coefficients, its.coefficients):
            return f"the plan takes {its.duration:.9g} s, there {own.duration:.9g} s"
        if self.flight is None or other.flight is None:
            return ""
        its_series = other.flight.series
        names = [name for name, series in self.flight.series.items() if not _same(series, its_series[name])]
        return f"the plan is the same, the flight's {', '.join(names)} are not" if names else ""


def _same(a: NDArray[Any], b: NDArray[Any]) -> bool:
    return a.shape == b.shape and a.tobytes() == b.tobytes()
