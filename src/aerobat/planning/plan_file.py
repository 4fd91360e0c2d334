"""Plans as files: everything that a plan is, in one file that whatever follows can read.

A .plan file is a NumPy .npz archive without pickles. Its arrays `durations` (S,), `coefficients`
(S, degree + 1, 3) and `heading` are the trajectory's, bit for bit; `document` holds, as UTF-8 JSON, the rest:
the problem and the vehicle as the tables of their files, the environment in full, how the plan was made, its
stages, attempts, certificate, flyability, recoveries, assessment and tube, frames, and which version of
Aerobat wrote it.

Schema and version rules are in docs/flight-package.md. `interchange.flight_package` reads it by NumPy alone.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from importlib.metadata import version
from typing import Any

import numpy as np

from aerobat.certification import Certificate
from aerobat.declaration import PathName, from_table, to_table, validated
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.planning.assessment.assessment import Assessment
from aerobat.planning.recorder import Attempt
from aerobat.planning.result import Flyability, PlacedStage, Plan
from aerobat.planning.tube import Tube
from aerobat.problem.problem import Problem
from aerobat.simulation.autopilot import Recoveries
from aerobat.storage import format_of, read_arrays, whole_file
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

FORMAT = "aerobat-plan-1"  # another number where something goes, or means something else
REVISION = 4  # of it: one more wherever something is added
FRAMES = {
    "world": "ENU: x east, y north, z up [m]",
    "body": "FLU: x forward, y left, z up, thrust along +z",
    "attitude": "unit quaternion (w, x, y, z), Hamilton, body to world",
    "units": "SI, angles in radians but for keys that end in _deg",
}


@dataclass(frozen=True)
class _Evidence:
    """Content of a document beside problem and vehicle: the fields of Plan of those names."""

    planner: str
    order: int | None
    cost: float | None
    status: str
    backend: str
    stages: tuple[PlacedStage, ...]
    attempts: tuple[Attempt, ...]
    dt: float | None
    bound: float | None
    gap: float | None
    certificate: Certificate | None
    flyability: Flyability | None = None
    recoveries: Recoveries | None = None
    assessment: Assessment | None = None
    rescue: str = ""
    starts: tuple[float, ...] = ()
    tube: Tube | None = None


def save_plan(plan: Plan, path: PathName) -> None:
    """Write a plan with its problem, vehicle and certificate, whole or not at all.

    Raises SpecError when the file cannot be written, or for a maneuver that is not registered.
    """
    evidence = _Evidence(**{field.name: getattr(plan, field.name) for field in fields(_Evidence)})
    document = {
        "revision": REVISION,
        "aerobat": version("aerobat"),
        "frames": FRAMES,
        "environment": _in_full(plan.problem.environment),
        "problem": to_table(plan.problem),
        "vehicle": None if plan.vehicle is None else to_table(plan.vehicle),
        "evidence": evidence_adapter().dump_python(evidence, mode="json"),
    }
    with whole_file(path) as temporary, temporary.open("wb") as file:
        np.savez(
            file,
            format=FORMAT,
            durations=plan.trajectory.durations,
            coefficients=plan.trajectory.coefficients,
            heading=plan.trajectory.heading,
            document=np.frombuffer(json.dumps(document).encode(), dtype=np.uint8),
        )


@validated
def load_plan(path: PathName) -> Plan:
    """Read what `Plan.save` wrote, exactly. Raises SpecError, one sentence, for any other file."""
    content = read_arrays(path, "plan")
    found = format_of(content)
    if found != FORMAT:
        raise SpecError(f"plan file {path}: it holds {found}, not {FORMAT}; plan again and save that")
    try:
        document = json.loads(content["document"].tobytes())
        evidence: _Evidence = evidence_adapter().validate_python(document["evidence"])
        vehicle = document["vehicle"]
        return Plan(
            problem=from_table(Problem, document["problem"]),
            trajectory=Trajectory(content["durations"], content["coefficients"], float(content["heading"])),
            vehicle=None if vehicle is None else from_table(Vehicle, vehicle),
            **vars(evidence),
        )
    except KeyError as error:
        raise SpecError(f"plan file {path}: it has no {error.args[0]!r}; save it again") from None
    except SpecError as error:
        raise SpecError(f"plan file {path}: {error}") from None
    except (TypeError, ValueError, AttributeError, RecursionError):  # not JSON, not such a document
        raise SpecError(f"plan file {path}: it is damaged; save it again") from None


def _in_full(environment: Environment) -> dict[str, Any]:
    """Its table with what is left out of problems' files, where it is as usual."""
    wind = environment.wind.tolist()
    return {"gravity": environment.gravity, "wind": wind, "ground": environment.ground}


def evidence_adapter() -> Any:
    """Read, write and describe a document's evidence, a pydantic TypeAdapter."""
    from pydantic import TypeAdapter

    return TypeAdapter(_Evidence)
