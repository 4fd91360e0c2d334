"""Trajectories with exact coefficients in .npz files."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from aerobat.arrays import Array
from aerobat.declaration import PathName, validated
from aerobat.errors import SpecError
from aerobat.storage import format_of, read_arrays, whole_file
from aerobat.trajectory.piecewise import Carrier, Trajectory, as_trajectory

_FORMAT = "aerobat-trajectory-3"
_WITHOUT_YAW = "aerobat-trajectory-2"  # written for trajectories without yaw
_WITHOUT_HEADING = "aerobat-trajectory-1"  # read with heading 0


@validated
def save_trajectory(trajectory: Trajectory | Carrier, path: PathName) -> None:
    """Write durations (S,), coefficients (S, degree + 1, 3), heading and any yaw (S, any) as an .npz file.

    The file is written completely or not at all. SpecError is raised when it cannot be written.
    """
    trajectory = as_trajectory(trajectory)
    content: dict[str, ArrayLike] = {
        "format": _WITHOUT_YAW if trajectory.yaw is None else _FORMAT,
        **arrays_of(trajectory),
    }
    with whole_file(path) as temporary, temporary.open("wb") as file:
        np.savez(file, allow_pickle=False, **content)


@validated
def load_trajectory(path: PathName) -> Trajectory:
    """Read a file of `save_trajectory` exactly. Raise SpecError for any other file."""
    content = read_arrays(path, "trajectory")
    found = format_of(content)
    if found not in (_FORMAT, _WITHOUT_YAW, _WITHOUT_HEADING):
        raise SpecError(f"trajectory file {path}: it holds {found}, not {_FORMAT}; give a trajectory's file")
    try:
        return trajectory_in({"heading": np.zeros(())} | content if found == _WITHOUT_HEADING else content)
    except KeyError as error:
        raise SpecError(f"trajectory file {path}: it has no array {error.args[0]!r}; save it again") from None
    except SpecError as error:
        raise SpecError(f"trajectory file {path}: {error}") from None


def arrays_of(trajectory: Trajectory) -> dict[str, Array]:
    """Return the arrays that define a trajectory bit for bit, as stored in a file."""
    names = ("durations", "coefficients", "heading", *(() if trajectory.yaw is None else ("yaw",)))
    return {name: np.asarray(getattr(trajectory, name)) for name in names}


def trajectory_in(arrays: Mapping[str, Array]) -> Trajectory:
    """Return the trajectory stored in a file's arrays. Raise KeyError for a missing one."""
    durations, coefficients, heading = (arrays[name] for name in ("durations", "coefficients", "heading"))
    return Trajectory(durations, coefficients, heading, arrays.get("yaw"))  # type: ignore[arg-type]
