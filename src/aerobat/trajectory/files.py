"""Trajectories as they are, coefficients and all, in .npz files and back."""

from __future__ import annotations

import numpy as np

from aerobat.declaration import PathName, validated
from aerobat.errors import SpecError
from aerobat.storage import format_of, read_arrays, whole_file
from aerobat.trajectory.piecewise import Carrier, Trajectory, as_trajectory

_FORMAT = "aerobat-trajectory-2"
_WITHOUT_HEADING = "aerobat-trajectory-1"  # read with heading 0


@validated
def save_trajectory(trajectory: Trajectory | Carrier, path: PathName) -> None:
    """Write durations (S,), coefficients (S, degree + 1, 3) and heading as an .npz file, whole or not at all.

    Raises SpecError when the file cannot be written.
    """
    trajectory = as_trajectory(trajectory)
    with whole_file(path) as temporary, temporary.open("wb") as file:
        np.savez(
            file,
            format=_FORMAT,
            durations=trajectory.durations,
            coefficients=trajectory.coefficients,
            heading=trajectory.heading,
        )


@validated
def load_trajectory(path: PathName) -> Trajectory:
    """Read what `save_trajectory` wrote, exactly. Raises SpecError, one sentence, for any other file."""
    content = read_arrays(path, "trajectory")
    found = format_of(content)
    if found not in (_FORMAT, _WITHOUT_HEADING):
        raise SpecError(f"trajectory file {path}: it holds {found}, not {_FORMAT}; give a trajectory's file")
    try:
        heading = content["heading"] if found == _FORMAT else np.zeros(())
        return Trajectory(content["durations"], content["coefficients"], heading)  # type: ignore[arg-type]
    except KeyError as error:
        raise SpecError(f"trajectory file {path}: it has no array {error.args[0]!r}; save it again") from None
    except SpecError as error:
        raise SpecError(f"trajectory file {path}: {error}") from None
