"""Plans and bare trajectories, read from .plan, .npz and CSV files, or from a folder with such a file."""

from __future__ import annotations

import os
from pathlib import Path

from aerobat.declaration import PathName, Positive, validated
from aerobat.errors import SpecError
from aerobat.interchange.csv import read_csv
from aerobat.planning import Plan, load_plan
from aerobat.trajectory import Trajectory, load_trajectory

PATTERNS = ("*.plan", "plan.npz", "plan.csv")  # of a folder's files, in order of preference


@validated
def read_plan(path: PathName, rate: Positive = 100.0) -> Plan | Trajectory:
    """Read a .plan file as a plan, or an .npz or CSV file, with rows at `rate` [1/s], as a bare trajectory.

    From a folder, the plan of the run there is read. Raises SpecError, one sentence, where there is none,
    where there are several, and where the file is malformed.
    """
    path = plan_file(Path(path))
    if path.suffix == ".toml" and path.is_file():
        raise SpecError(f"{path} holds no plan; `aerobat fly {path}` makes that of a problem")
    if path.suffix == ".plan":
        return load_plan(path)
    return load_trajectory(path) if path.suffix == ".npz" else read_csv(path, rate)


@validated
def read_trajectory(path: PathName, rate: Positive = 100.0) -> Trajectory:
    """Read the trajectory alone from what `read_plan` reads. Raises SpecError as `read_plan` does."""
    found = read_plan(path, rate)
    return found.trajectory if isinstance(found, Plan) else found


def plan_file(path: Path) -> Path:
    """Return the file that holds a plan: the path itself, or the only one in a folder.

    Raises SpecError where nothing is there, and where the folder holds none, or several.
    """
    if not os.path.exists(path):  # Path.exists raises for a name that is too long, and Path.is_dir
        raise SpecError(f"{path}: there is no such file or folder; `aerobat fly PROBLEM` writes one")
    if not os.path.isdir(path):
        return path
    for pattern in PATTERNS:
        found = sorted(path.glob(pattern))
        if len(found) > 1:
            raise SpecError(f"{path}/ holds {found[0].name} and {found[1].name}; give one of the files")
        if found:
            return found[0]
    raise SpecError(f"{path}/ holds no .plan file and no plan.csv; give the file of a trajectory")
