"""What a run was: all that it takes to repeat it, as `run.toml` in its folder."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from platform import python_version
from typing import Annotated, Any, Literal

from pydantic import PlainValidator

from aerobat.declaration import Count, NonNegative, Positive, Seed, declared, to_table
from aerobat.documents import read_document, write_document
from aerobat.environment import Dispersion
from aerobat.errors import SpecError
from aerobat.evaluation.opening import Probability
from aerobat.interchange.columns import ALL
from aerobat.planning import Planner
from aerobat.planning.planners import PLANNERS
from aerobat.problem import Problem
from aerobat.provenance import installed_versions
from aerobat.vehicle import Vehicle

RECORD = "run.toml"
LIBRARIES = (
    "aerobat",
    "numpy",
    "scipy",
    "daqp",
    "casadi",
    "gurobipy",
    "pyscipopt",
    "llvmlite",
    "jax",
    "pyarrow",
)


def _planner(value: Any) -> Planner | None:
    return None if value is None else PLANNERS.read(value)


@declared
class FlightSettings:
    """How a plan was flown."""

    controller: str = "full"
    conditions: Dispersion | None = None  # left out, as planned
    seed: Seed = 0  # of the conditions
    plant: str | None = None  # whose physics, left out the built-in
    runs: Count = 1  # flights of a sweep
    table: Literal["csv", "parquet"] = "csv"  # the form of the table of a sweep, or of a map
    probability: Probability | None = None  # of passing under the conditions, that it was planned for


@declared
class RunRecord:
    """A run in full: with the same libraries it gives the same numbers again.

    Without a planner, the plan came from a file and lies in the folder; `compare` takes all planners.
    """

    command: Literal["fly", "plan", "compare", "sweep", "map", "need"]
    problem: Problem  # as it was planned, with --angle and --paper
    vehicle: Vehicle
    planner: Annotated[Planner | None, PlainValidator(_planner)] = None
    paper: bool = False  # planned without the vehicle
    angle: float | None = None  # [deg] that --angle gave, for the folder's name
    source: str | None = None  # the file that the plan came from
    flight: FlightSettings = FlightSettings()
    time_limit: NonNegative | None = None  # [s] of each planner that is compared, or of each of many plans
    over: tuple[str, ...] = ()  # fields and values of a map, as --over gave them
    of: tuple[str, ...] | None = None  # what the least is sought of, left out all that there is
    tolerance: Positive = 0.01  # of that, between the answer and a refusal
    columns: tuple[str, ...] = ALL  # of plan.csv
    plugins: tuple[str, ...] = ()  # files that --import named
    versions: Mapping[str, str] = field(default_factory=dict)  # of what made it
    format: Literal["aerobat-run-1"] = "aerobat-run-1"

    @property
    def folder(self) -> Path:
        """Where the run is written unless another place is given: whatever is not default is in the name."""
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
        if self.command in ("sweep", "map", "need"):
            parts.append(self.command)
        if self.flight.probability is not None:
            parts.append(f"pass-{self.flight.probability:g}")
        if self.flight.conditions is not None:
            parts.append(self.flight.conditions.name)
        return Path("out") / "-".join(re.sub(r"[^\w.-]+", "-", part) for part in parts)

    @property
    def planner_name(self) -> str:
        """The registered name of the planner."""
        return str(getattr(self.planner, "kind", ""))


def default_vehicle(paper: bool = False) -> str:
    """The name of the vehicle that is taken where none is given."""
    return "hexarotor" if paper else "agile-quad"


def write_record(record: RunRecord, folder: Path) -> None:
    """Write a run's record to its folder, with the versions of all that may change its numbers."""
    facts = {"format": record.format, "versions": versions_now()}
    write_document(folder / RECORD, to_table(record) | facts)


def read_record(folder: Path) -> RunRecord:
    """What a folder says of its run. Raises SpecError, one sentence, where it says nothing that is whole."""
    if not os.path.isdir(folder):
        raise SpecError(f"{folder} is no folder; give the folder of a run")
    if not (folder / RECORD).exists():
        raise SpecError(f"{folder}/ has no {RECORD}, so that no run can be repeated from it; run anew")
    return read_document(folder / RECORD, RunRecord, "run")


def versions_now() -> dict[str, str]:
    """The versions of Python, Aerobat and the libraries that its numbers come from."""
    return {"python": python_version()} | installed_versions(LIBRARIES)
