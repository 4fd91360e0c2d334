"""`aerobat repeat`: a run again from its folder, compared with what lies there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

from aerobat.cli.commands.compare import run_comparison
from aerobat.cli.commands.feasibility import run_map, run_need
from aerobat.cli.commands.fly import flown
from aerobat.cli.commands.sweep import run_sweep
from aerobat.cli.failures import ExitCode
from aerobat.cli.options import ExplainingOptions, OutputOptions, output
from aerobat.cli.runs.folder import FLIGHT, finish, require_place
from aerobat.cli.runs.record import RunRecord, beside, read_record, versions_now
from aerobat.cli.runs.saved_plans import whole_plan
from aerobat.cli.tasks import plan_of
from aerobat.cli.terminal import say
from aerobat.documents import read_json
from aerobat.errors import SpecError
from aerobat.interchange import read_table
from aerobat.planning import Plan
from aerobat.registry import imported_plugins
from aerobat.simulation import Flight, load_flight

STUDIES: Mapping[str, Callable[[RunRecord, OutputOptions], None]] = {  # by commands; a sweep needs its plan
    "compare": run_comparison,
    "map": run_map,
    "need": run_need,
}


@dataclass(frozen=True, kw_only=True)
class RepeatOptions(OutputOptions, ExplainingOptions):
    """Options of a run that is repeated."""

    out: Annotated[Path | None, Parameter(group=output)] = None
    """The folder to write to, replaced as a whole. Default: FOLDER-repeated, beside the one repeated."""


def repeat(folder: Path, options: RepeatOptions = RepeatOptions()) -> ExitCode:
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
    out = options.out or beside(folder, "-repeated")
    options = replace(options, out=out)
    require_place(record, options)
    if record.command not in ("fly", "plan"):
        if options.explain:
            raise SpecError(f"--explain is for a plan or a flight, and {folder}/ holds neither; leave it out")
        earlier = _results(folder, record)
        _run_study(folder, record, options)
        names = [name for name, value in _results(out, record).items() if not _same(value, earlier.get(name))]
        return _compared(folder, record, f"{', '.join(names)} differ" if names else "", ExitCode.WELL)
    before = whole_plan(folder, "run anew")
    flight = load_flight(folder / FLIGHT) if record.command == "fly" else None
    plan = plan_of(record, before if record.planner is None else None, options.explain)
    again = None if flight is None else flown(plan, record.flight)
    code = finish(plan, record, options, again, options.explain)
    return _compared(folder, record, _difference(before, flight, plan, again.flight if again else None), code)


def _run_study(folder: Path, record: RunRecord, options: RepeatOptions) -> None:
    """Do the study in a folder again."""
    if record.command in STUDIES:
        STUDIES[record.command](record, options)
    else:
        plan = whole_plan(folder, "run anew") if record.planner is None else plan_of(record)
        run_sweep(plan, record, options)


def _results(folder: Path, record: RunRecord) -> Mapping[str, Any]:
    """Read what a study in a folder came to, by names: the columns of its table, or its facts.

    Of a comparison, the durations of its plans: times of the clock are others whenever it is repeated.
    Raises SpecError where none are there.
    """
    tables = {"sweep": "flights", "map": "map"}
    if record.command in tables:
        return read_table(folder / f"{tables[record.command]}.{record.flight.table}")
    name = f"{record.command}.json"
    try:
        facts = read_json(folder / name)
    except SpecError:
        raise SpecError(f"{folder}/ has no {name} that can be read; run anew") from None
    try:
        if record.command == "need":
            return dict(facts)
        return {
            f"the duration by {row['planner']} {k}": row["duration_s"]
            for k, row in enumerate(facts["planners"])
        }
    except (TypeError, ValueError, KeyError):
        raise SpecError(f"{folder}/{name} holds other facts than were written; run anew") from None


def _compared(folder: Path, record: RunRecord, difference: str, code: ExitCode) -> ExitCode:
    """Say on standard error how a repeated run compares; one that differs is not well."""
    if not difference:
        say(f"the same as in {folder}/, bit for bit")
        return code
    now = versions_now()
    changed = [name for name in {*now, *record.versions} if now.get(name) != record.versions.get(name)]
    versions = f" (other versions of {', '.join(sorted(changed))})" if changed else ""
    say(f"not the same as in {folder}/: {difference}{versions}")
    return ExitCode.NOT_WELL


def _difference(plan: Plan, flight: Flight | None, again: Plan, flown_again: Flight | None) -> str:
    """Return how a repeated plan and its flight, if any, differ, in words; nothing where they do not."""
    own, its = plan.trajectory, again.trajectory
    same = _same(own.durations, its.durations) and _same(own.coefficients, its.coefficients)
    if same and own != its:
        return "the plan's heading is another"
    if not same:
        return f"the plan takes {its.duration:.9g} s, there {own.duration:.9g} s"
    if flight is None or flown_again is None:
        return ""
    its_series = flown_again.series
    names = [name for name, series in flight.series.items() if not _same(series, its_series[name])]
    return f"the plan is the same, the flight's {', '.join(names)} are not" if names else ""


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.shape == b.shape and a.tobytes() == b.tobytes()
    return bool(a == b)
