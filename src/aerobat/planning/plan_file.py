"""Plan files: a complete plan in one file that other programs can read.

A .plan file is a NumPy .npz archive without pickles. Its arrays `durations` (S,), `coefficients`
(S, degree + 1, 3), `heading` and, if there is one, `yaw` are the trajectory's, bit for bit. The array
`document` is UTF-8 JSON: problem and vehicle as in their own files, the environment in full, and how the plan
was made; stages, attempts, certificate, flyability, recoveries, assessment and tube; frames, and the version
of Aerobat that wrote the file. `digest` is the SHA-256 of all other content.

A file proves nothing: certificate, flyability and assessment of a plan that is read are computed anew.
Results that take seconds are taken from the file only if the digest shows that the file is unchanged.

Schema and version rules are in docs/flight-package.md. `examples/flight_package.py` reads such a file with
NumPy alone.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np

from aerobat.certification import Certificate
from aerobat.declaration import PathName, from_table, to_table
from aerobat.environment import Environment
from aerobat.environment.obstacles import ConvexPiece
from aerobat.errors import SpecError
from aerobat.planning.assessment.assessment import Assessment, SecondOpinion
from aerobat.planning.flyability import Flyability
from aerobat.planning.passages import PlacedStage
from aerobat.planning.recorder import Attempt
from aerobat.planning.tube import Tube
from aerobat.problem.problem import Problem
from aerobat.simulation.autopilot import Recoveries
from aerobat.storage import digest_of, format_of, read_arrays, whole_file
from aerobat.trajectory import Trajectory
from aerobat.trajectory.files import arrays_of, trajectory_in
from aerobat.vehicle import Vehicle

FORMAT = "aerobat-plan-1"  # gets another number where content is removed or changes its meaning
REVISION = 7  # of the format: increased by one where content is added
RECOMPUTED = {"certificate", "flyability", "assessment"}  # computed from a plan's path, never read
ON_REQUEST = {"recoveries", "opinion", "tube"}  # take seconds, read from files with a digest only
MAX_EVIDENCE = 2**23  # largest document [bytes]; a plan through twenty gates has some hundred thousand
FRAMES = {
    "world": "ENU: x east, y north, z up [m]",
    "body": "FLU: x forward, y left, z up, thrust along +z",
    "attitude": "unit quaternion (w, x, y, z), Hamilton, body to world",
    "units": "SI, angles in radians but for keys that end in _deg",
}


@dataclass(frozen=True)
class PlanRecord:
    """Content of a document beside problem and vehicle, as Plan names it."""

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
    opinion: SecondOpinion | None = None
    reserve: float = 0.0


def write_plan_file(
    path: PathName, problem: Problem, trajectory: Trajectory, vehicle: Vehicle | None, facts: PlanRecord
) -> None:
    """Write a plan completely or not at all.

    Raises SpecError when the file cannot be written, or for a maneuver that is not registered.

    Args:
        path: Path of the file.
        problem: The plan's problem.
        trajectory: The plan's trajectory.
        vehicle: The plan's vehicle, if any.
        facts: All other fields of the plan.
    """
    document = {
        "revision": REVISION,
        "aerobat": version("aerobat"),
        "frames": FRAMES,
        "environment": _in_full(problem.surroundings),
        "problem": to_table(problem),
        "vehicle": None if vehicle is None else to_table(vehicle),
        "evidence": facts_adapter().dump_python(facts, mode="json"),
    }
    content: dict[str, Any] = {
        "format": np.asarray(FORMAT),
        **arrays_of(trajectory),
        "document": np.frombuffer(json.dumps(document).encode(), dtype=np.uint8),
    }
    with whole_file(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **content, digest=digest_of(content))


def read_plan_file(path: PathName) -> tuple[Problem, Trajectory, Vehicle | None, dict[str, Any]]:
    """Return a plan's problem, trajectory, vehicle, and by name the other fields that are not computed anew.

    Revisions before 4 have no digest: their recoveries, tubes and second opinions are left out.
    Raises SpecError, one sentence, for another file, a damaged or a changed one.
    """
    content = read_arrays(path, "plan")
    found = format_of(content)
    if found != FORMAT:
        raise SpecError(f"plan file {path}: it holds {found}, not {FORMAT}; plan again and save that")
    if "digest" in content and str(content["digest"]) != digest_of(content):
        raise SpecError(f"plan file {path}: it was changed after it was written; plan again and save that")
    left_out = RECOMPUTED if "digest" in content else RECOMPUTED | ON_REQUEST
    try:
        text = content["document"].tobytes()
        if len(text) > MAX_EVIDENCE:
            raise SpecError(f"its document has {len(text)} bytes, more than {MAX_EVIDENCE}; save it again")
        document = json.loads(text)
        facts: PlanRecord = facts_adapter().validate_python(document["evidence"])
        vehicle = document["vehicle"]
        return (
            from_table(Problem, document["problem"]),
            trajectory_in(content),
            None if vehicle is None else from_table(Vehicle, vehicle),
            {name: value for name, value in vars(facts).items() if name not in left_out},
        )
    except KeyError as error:
        raise SpecError(f"plan file {path}: it has no {error.args[0]!r}; save it again") from None
    except SpecError as error:
        raise SpecError(f"plan file {path}: {error}") from None
    except (TypeError, ValueError, AttributeError, RecursionError):  # not JSON, not such a document
        raise SpecError(f"plan file {path}: it is damaged; save it again") from None


def _in_full(environment: Environment) -> dict[str, Any]:
    """Return the environment's table with defaults written out, and with obstacles as convex pieces."""
    return {
        "gravity": environment.gravity,
        "wind": environment.wind.tolist(),
        "ground": environment.ground,
        "obstacles": [_piece_in_full(piece) for piece in environment.pieces.pieces],
    }


def _piece_in_full(piece: ConvexPiece) -> dict[str, Any]:
    still = {"name": piece.name, "points": piece.points.tolist(), "rounding": piece.rounding.tolist()}
    motion = piece.motion
    return still if motion is None else still | {"motion": [motion.velocity.tolist(), motion.rows.tolist()]}


def facts_adapter() -> Any:
    """Return the pydantic TypeAdapter that reads, writes and describes `evidence` of a document."""
    from pydantic import TypeAdapter

    return TypeAdapter(PlanRecord)
