"""`aerobat repeat`: a run again from its folder, compared with what lies there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

from aerobat.cli.commands.compare import comparison_of
from aerobat.cli.commands.feasibility import finish_map, finish_need, map_of, need_of
from aerobat.cli.commands.fly import flown
from aerobat.cli.commands.sweep import finish_sweep, sweep_of, table_name
from aerobat.cli.failures import ExitCode
from aerobat.cli.options import ExplainingOptions, OutputOptions, output
from aerobat.cli.runs.folder import FLIGHT, finish, finish_study
from aerobat.cli.runs.record import RunRecord, read_record, versions_now
from aerobat.cli.tasks import plan_of
from aerobat.cli.terminal import say
from aerobat.declaration.registry import imported_plugins
from aerobat.documents import read_json
from aerobat.errors import SpecError
from aerobat.interchange import read_plan, read_table
from aerobat.planning import Plan, with_explanation
from aerobat.reporting.feasibility.facts import requirements
from aerobat.reporting.plain_data import plain
from aerobat.simulation import Flight, load_flight


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
    imported = imported_plugins()
    missing = [file for file in record.plugins if str(Path(file).resolve()) not in imported]
    if missing:
        raise SpecError(f"{folder}/ was made with --import {' '.join(missing)}; give that here too")
    out = options.out or folder.with_name(f"{folder.resolve().name}-repeated")
    options = replace(options, out=out)
    if record.command in STUDIES:
        old, again = STUDIES[record.command](folder, record, options)
        names = [name for name, value in again.items() if not _same(value, old.get(name))]
        return _told(folder, record, f"{', '.join(names)} differ" if names else "", ExitCode.WELL)
    run = _Run.read(folder, record)
    if record.planner is not None:
        plan = plan_of(record, options.explain)
    else:
        plan = with_explanation(run.plan) if options.explain else run.plan
    flight = flown(plan, record.flight) if record.command == "fly" else None
    code = finish(plan, record, options, flight, options.explain)
    return _told(folder, record, run.difference(_Run(plan, flight.flight if flight else None)), code)


Compared = tuple[Mapping[str, Any], Mapping[str, Any]]  # what lies in a folder, and what came again, by names


def _repeat_comparison(folder: Path, record: RunRecord, options: RepeatOptions) -> Compared:
    old = _there(folder / "compare.json")
    comparison = comparison_of(record)
    finish_study(comparison, record, options)
    return _durations(old), _durations(plain(comparison))


def _repeat_sweep(folder: Path, record: RunRecord, options: RepeatOptions) -> Compared:
    old = read_table(folder / table_name(record.flight))
    plan = _Run.read(folder, record).plan if record.planner is None else plan_of(record)
    swept = sweep_of(plan, record, options)
    finish_sweep(swept, record, options)
    return old, swept.table


def _repeat_map(folder: Path, record: RunRecord, options: RepeatOptions) -> Compared:
    old = read_table(folder / f"map.{record.flight.table}")
    found = map_of(record, options)
    finish_map(found, record, options)
    return old, found.table


def _repeat_need(folder: Path, record: RunRecord, options: RepeatOptions) -> Compared:
    old = _there(folder / "need.json")
    found = need_of(record)
    finish_need(found, record, options)
    return old, plain(requirements(record.problem.name, record.vehicle.name, found))


STUDIES = {
    "compare": _repeat_comparison,
    "sweep": _repeat_sweep,
    "map": _repeat_map,
    "need": _repeat_need,
}


def _there(file: Path) -> Any:
    """Read a study's facts. Raises SpecError where none are there."""
    try:
        return read_json(file)
    except SpecError:
        raise SpecError(f"{file.parent}/ has no {file.name} that can be read; run anew") from None


def _durations(told: Any) -> Mapping[str, Any]:
    """The durations of a comparison's plans: times of the clock are others whenever it is repeated."""
    try:
        return {
            f"the duration by {row['planner']} {k}": row["duration_s"]
            for k, row in enumerate(told["planners"])
        }
    except (TypeError, KeyError):
        raise SpecError("compare.json is no comparison; compare anew") from None


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
        same = _same(own.durations, its.durations) and _same(own.coefficients, its.coefficients)
        if same and own != its:
            return "the plan's heading is another"
        if not same:
            return f"the plan takes {its.duration:.9g} s, there {own.duration:.9g} s"
        if self.flight is None or other.flight is None:
            return ""
        its_series = other.flight.series
        names = [name for name, series in self.flight.series.items() if not _same(series, its_series[name])]
        return f"the plan is the same, the flight's {', '.join(names)} are not" if names else ""


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.shape == b.shape and a.tobytes() == b.tobytes()
    return bool(a == b)
