"""Finished flights of a sweep in a folder, from which one that was ended goes on."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerobat.declaration import to_table
from aerobat.documents import read_json
from aerobat.errors import SpecError
from aerobat.planning import Plan
from aerobat.provenance import installed_versions
from aerobat.storage import digest_of, read_arrays, whole_file, write_whole
from aerobat.studies.flights import CHUNK, FlightTask
from aerobat.studies.sweep.flights import SAMPLED, STRIDE, Chunk

FINGERPRINT = "fingerprint.json"
LIBRARIES = ("aerobat", "numpy", "llvmlite", "jax")  # that the numbers of flights come from
_OVER_TIME = ("times", "position_error", "attitude_error")


@dataclass(frozen=True)
class KeptChunks:
    """The folder of a sweep's finished chunks, each a file that is whole or absent."""

    folder: Path

    @classmethod
    def of(cls, folder: Path, task: FlightTask) -> KeptChunks:
        """The folder, new or of the same sweep. Raises SpecError, one sentence, for any other's."""
        own = fingerprint(task)
        path = folder / FINGERPRINT
        try:
            is_new = not folder.exists() or not any(folder.iterdir())
        except OSError as error:
            raise SpecError(f"cannot keep flights in {folder}: {error.strerror or error}") from None
        if is_new:
            write_whole(path, json.dumps(own, indent=2) + "\n")
            return cls(folder)
        try:
            found = read_json(path)
            differing = [key for key in own if found[key] != own[key]]
        except (SpecError, KeyError, TypeError):
            raise SpecError(f"{folder}/ keeps no flights of a sweep; name a folder of its own") from None
        if differing:
            others = " and ".join(differing)
            raise SpecError(f"{folder}/ keeps flights of another sweep ({others}); remove it to begin anew")
        return cls(folder)

    def read(self, flights: range) -> Chunk | None:
        """Finished flights; None where there are none, or none as they were kept."""
        try:
            arrays = read_arrays(self._path(flights), "sweep")
            if str(arrays["digest"]) != digest_of(arrays):
                return None
            columns = {str(name): arrays[f"column_{k}"] for k, name in enumerate(arrays["names"])}
            found = Chunk(columns, *(arrays[name] for name in _OVER_TIME))
        except (SpecError, KeyError, TypeError):
            return None
        return found if all(column.shape == (len(flights),) for column in columns.values()) else None

    def write(self, flights: range, chunk: Chunk) -> None:
        """Keep finished flights."""
        arrays: dict[str, Any] = {"names": np.array(list(chunk.columns))}
        arrays |= {name: getattr(chunk, name) for name in _OVER_TIME}
        arrays |= {f"column_{k}": column for k, column in enumerate(chunk.columns.values())}
        with whole_file(self._path(flights)) as temporary, temporary.open("wb") as file:
            np.savez(file, **arrays, digest=digest_of(arrays))

    def remove(self) -> None:
        """Remove the folder, as its flights are kept elsewhere by now."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _path(self, flights: range) -> Path:
        return self.folder / f"flights-{flights.start}-{flights.stop}.npz"


def finished_flights(folder: Path) -> int:
    """Return the number of flights that a folder keeps."""
    spans = (path.stem.split("-")[1:] for path in folder.glob("flights-*-*.npz"))
    return sum(int(end) - int(begin) for begin, end in spans)


def fingerprint(task: FlightTask) -> dict[str, Any]:
    """All that the numbers of flights depend on, in few words; batches and cores are not among it."""
    return {
        "format": "aerobat-sweep-1",
        "plan": _digest(_plan_table(task.plan)),
        "vehicle": _digest(to_table(task.vehicle)),
        "conditions": _digest(to_table(task.conditions)),
        "seed": task.seed,
        "controller": _digest(to_table(task.controller)),
        "engine": task.engine,
        "chunks": [CHUNK, SAMPLED, STRIDE],
        "versions": installed_versions(LIBRARIES),
    }


def _plan_table(plan: Plan) -> dict[str, Any]:
    """What of a plan is flown and judged."""
    trajectory = plan.trajectory
    return {
        "problem": to_table(plan.problem),
        "stages": [asdict(stage) for stage in plan.stages],
        "durations": trajectory.durations.tolist(),
        "coefficients": trajectory.coefficients.tolist(),
        "heading": trajectory.heading,
        **({} if trajectory.yaw is None else {"yaw": trajectory.yaw.tolist()}),
    }


def _digest(table: Any) -> str:
    return hashlib.sha256(json.dumps(table, sort_keys=True).encode()).hexdigest()[:16]
