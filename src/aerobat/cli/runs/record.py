"""Record of a run: all that is needed to repeat it, as `run.toml` in its folder."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import field
from hashlib import sha256
from pathlib import Path
from platform import python_version
from typing import Annotated, Literal

from pydantic import PlainValidator

from aerobat.declaration import Count, NonNegative, Positive, Seed, declared, to_table
from aerobat.documents import read_document, write_document
from aerobat.environment import Dispersion
from aerobat.errors import SpecError
from aerobat.evaluation.opening import Probability
from aerobat.interchange.columns import ALL
from aerobat.planning import Planner, command_settings, planner_options
from aerobat.planning.planners import DEFAULT_VEHICLE, PLANNERS
from aerobat.problem import Problem
from aerobat.provenance import installed_versions
from aerobat.vehicle import Vehicle

RECORD = "run.toml"
DEFAULT_TOLERANCE = 0.01  # of a search for least values
MAX_NAME = 200  # bytes of a folder's name; most systems take 255
LIBRARIES = (
    "aerobat",
    "numpy",
    "scipy",
    "daqp",
    "gurobipy",
    "pyscipopt",
    "llvmlite",
    "jax",
    "pyarrow",
)


@declared
class FlightSettings:
    """Settings by which a plan was flown."""

    controller: str = "full"
    conditions: Dispersion | None = None  # left out, as planned
    seed: Seed = 0  # of the conditions
    plant: str | None = None  # whose physics, left out the built-in
    autopilot: str | None = None  # the firmware of the inner loop, left out our model of one
    runs: Count = 1  # flights of a sweep
    table: Literal["csv", "parquet"] = "csv"  # the form of the table of a sweep, or of a map
    probability: Probability | None = None  # of passing under the conditions, that it was planned for


@declared
class RunRecord:
    """A run in full: with the same libraries, its repetition gives the same numbers.

    Without a planner, the plan came from a file and is in the folder; `compare` uses all planners.
    """

    command: Literal["fly", "plan", "compare", "sweep", "map", "need"]
    problem: Problem  # as it was planned, with --angle and --paper
    vehicle: Vehicle
    planner: Annotated[Planner, PlainValidator(PLANNERS.read)] | None = None
    paper: bool = False  # planned without the vehicle
    angle: float | None = None  # [deg] that --angle gave, for the folder's name
    source: str | None = None  # the file that the plan came from
    flight: FlightSettings = FlightSettings()
    time_limit: NonNegative | None = None  # [s] of each planner that is compared, or of each of many plans
    over: tuple[str, ...] = ()  # fields and values of a map, as --over gave them
    of: tuple[str, ...] | None = None  # what the least is sought of, left out all that there is
    tolerance: Positive = DEFAULT_TOLERANCE  # of that, between the answer and a refusal
    columns: tuple[str, ...] = ALL  # of plan.csv
    plugins: tuple[str, ...] = ()  # files that --import named
    versions: Mapping[str, str] = field(default_factory=dict)  # of what made it
    format: Literal["aerobat-run-1"] = "aerobat-run-1"

    @property
    def folder(self) -> Path:
        """The default folder of the run; its name tells all options that are not default."""
        parts = [self.problem.name]
        if self.vehicle.name != default_vehicle(self.paper):
            parts.append(self.vehicle.name)
        if self.angle is not None:
            parts.append(f"{self.angle:g}deg")
        if self.planner is None:
            parts += {"fly": ["flown"], "plan": ["judged"], "compare": ["compare"]}.get(self.command, [])
        elif self.planner_name != "miqp":
            parts.append(self.planner_name)
        if self.paper:
            parts.append("paper")
        parts += self._planner_settings
        if self.command in ("sweep", "map", "need"):
            parts.append(self.command)
        name = "-".join(re.sub(r"[^\w.-]+", "-", part) for part in [*parts, *self._study_settings])
        return Path("out") / _short(name)

    @property
    def _planner_settings(self) -> Iterator[str]:
        """The planner's options that differ from the command's defaults, in words."""
        if self.planner is None:
            return
        usual = command_settings(type(self.planner)) | ({"order": 3} if self.paper else {})
        for option in planner_options(type(self.planner)):
            value = getattr(self.planner, option.name)
            if value != usual.get(option.name, option.default):
                flag = option.flag.removeprefix("--")
                shown = f"{value:g}" if isinstance(value, float) else value
                yield flag if option.type is bool else f"{flag}-{shown}"

    @property
    def _study_settings(self) -> Iterator[str]:
        """The settings of flights and of a study that are not default, in words.

        The number of flights is left out, since a sweep with more flights continues one with fewer.
        """
        flight = self.flight
        if flight.probability is not None:
            yield f"pass-{flight.probability:g}"
        if flight.conditions is not None:
            yield flight.conditions.name
        if flight.seed:
            yield f"seed-{flight.seed}"
        if flight.controller != ("full" if flight.autopilot is None else "rates"):
            yield flight.controller
        if flight.autopilot is not None:
            yield flight.autopilot
        if flight.plant is not None:
            yield flight.plant
        if flight.table != "csv":
            yield flight.table
        yield from (*self.over, *(self.of or ()))
        if self.tolerance != DEFAULT_TOLERANCE:
            yield f"tolerance-{self.tolerance:g}"
        if self.command == "compare" and self.time_limit is not None:  # a planner has its own
            yield f"time-limit-{self.time_limit:g}"
        if self.columns != ALL:
            yield "columns-" + "-".join(self.columns)

    @property
    def planner_name(self) -> str:
        """The registered name of the planner."""
        return str(getattr(self.planner, "kind", ""))


def _short(name: str) -> str:
    """Return the name, shortened to its beginning and a digest if it is too long."""
    encoded = name.encode()
    if len(encoded) <= MAX_NAME:
        return name
    return f"{encoded[:MAX_NAME].decode(errors='ignore')}-{sha256(encoded).hexdigest()[:8]}"


def beside(folder: Path, suffix: str) -> Path:
    """Return the path beside a folder that has its name and a suffix. Raises SpecError for the root."""
    named = folder.resolve() if folder.name in ("", "..") else folder
    if not named.name:
        raise SpecError(f"there is no place beside {folder}; give another folder")
    return named.with_name(f"{named.name}{suffix}")


def default_vehicle(paper: bool = False) -> str:
    """Return the name of the default vehicle."""
    return "hexarotor" if paper else DEFAULT_VEHICLE


def write_record(record: RunRecord, folder: Path) -> None:
    """Write a run's record to its folder, with the versions of libraries that may change its numbers."""
    facts = {"format": record.format, "versions": versions_now()}
    write_document(folder / RECORD, to_table(record) | facts)


def read_record(folder: Path) -> RunRecord:
    """Return the record in a run's folder. Raises SpecError, one sentence, where there is no whole record."""
    if not os.path.isdir(folder):
        raise SpecError(f"{folder} is no folder; give the folder of a run")
    if not (folder / RECORD).exists():
        raise SpecError(f"{folder}/ has no {RECORD}, so that no run can be repeated from it; run anew")
    return read_document(folder / RECORD, RunRecord, "run")


def versions_now() -> dict[str, str]:
    """Return the versions of Python, Aerobat and the libraries that its numbers depend on."""
    return {"python": python_version()} | installed_versions(LIBRARIES)
