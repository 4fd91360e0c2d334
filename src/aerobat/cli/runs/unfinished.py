"""Remains of a sweep that was ended, beside its folder: its plan, its record, and finished flights."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from aerobat.cli.runs.record import RECORD, RunRecord, read_record, write_record
from aerobat.errors import SpecError
from aerobat.planning import Plan, load_plan
from aerobat.studies.sweep.kept import finished_flights

PLAN = "sweep.plan"


@dataclass(frozen=True)
class Unfinished:
    """The folder of an unfinished sweep, beside the one that it is for."""

    folder: Path

    @classmethod
    def beside(cls, folder: Path) -> Unfinished:
        """Return the unfinished sweep beside the folder that the sweep is to be written to."""
        return cls(folder.with_name(f"{folder.name}-unfinished"))

    @property
    def flights(self) -> Path:
        """The folder of the finished flights."""
        return self.folder / "flights"

    @property
    def finished(self) -> int:
        """The number of finished flights that are kept."""
        return finished_flights(self.flights)

    def plan(self, record: RunRecord, make: Callable[[RunRecord], Plan]) -> Plan:
        """The plan of a sweep, kept or new; new ones are kept.

        Args:
            record: Of the sweep.
            make: Plans.

        Raises SpecError where the flights are those of another sweep.
        """
        if all(os.path.exists(self.folder / name) for name in (RECORD, PLAN)):
            if _without_runs(read_record(self.folder)) != _without_runs(record):
                raise SpecError(
                    f"{self.folder}/ keeps the flights of an unfinished sweep with other settings; repeat "
                    "those to finish it, remove it, or give another --out"
                )
            return load_plan(self.folder / PLAN)
        found = make(record)
        found.save(self.folder / PLAN)
        write_record(record, self.folder)
        return found

    def remove(self) -> None:
        """Remove what a sweep needs no longer."""
        shutil.rmtree(self.folder, ignore_errors=True)


def _without_runs(record: RunRecord) -> RunRecord:
    """The record without what changes no flight."""
    flight = replace(record.flight, runs=1, table="csv")
    return replace(record, flight=flight, versions={})
