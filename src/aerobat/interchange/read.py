"""Whatever holds a trajectory: our own file, rows of a CSV, or a folder with either."""

from __future__ import annotations

from pathlib import Path

from aerobat.errors import SpecError
from aerobat.interchange.csv import read_csv
from aerobat.trajectory import Trajectory, load_trajectory

PLAN_FILES = ("plan.npz", "plan.csv")


def read_trajectory(path: str | Path, rate: float = 100.0) -> Trajectory:
    """The trajectory in a plan.npz, a CSV file with `rate` [1/s] rows, or a folder that holds one of them.

    Raises SpecError, one sentence, when there is none or the file is malformed.
    """
    path = Path(path)
    if path.is_dir():
        found = next((path / name for name in PLAN_FILES if (path / name).is_file()), None)
        if found is None:
            raise SpecError(f"{path}/ holds no plan.npz and no plan.csv; give the file of a trajectory")
        path = found
    return load_trajectory(path) if path.suffix == ".npz" else read_csv(path, rate)
