"""Plans as tables for other programs: a header, then rows with the requested groups of columns.

The header names each column. Units are SI; vectors are in world axes, the attitude is body to world, and
rates are in body axes:

    t | x y z | vx vy vz | ax ay az | jx jy jz | qw qx qy qz | wx wy wz | f0 f1 ... (thrusts [N])

Columns are read back by their names, in any order; unknown columns are ignored.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import PathName, Positive, unknown_name, validated
from aerobat.errors import SpecError
from aerobat.flatness import reference
from aerobat.interchange.csv import write_csv
from aerobat.interchange.number_table import NAMES
from aerobat.interchange.rows import PATH
from aerobat.interchange.tables import csv_text
from aerobat.planning import Plan
from aerobat.storage import write_whole

PAPER = ("paper",)  # the bare layout of the paper's reference code, see `csv`
ALL = tuple(NAMES)


def column_groups(text: str) -> tuple[str, ...]:
    """Return the groups of columns that a text lists, separated by commas. Raises SpecError for others."""
    groups = tuple(name.strip() for name in text.split(","))
    if groups == PAPER:
        return PAPER
    if set(PAPER) & set(groups):
        raise SpecError(f"columns: paper is a whole layout; leave the others out, got {text}")
    for name in groups:
        if name not in NAMES:
            raise unknown_name("group of columns", name, [*NAMES, *PAPER])
    if len(set(groups)) < len(groups):
        raise SpecError(f"columns names a group twice: {text}; name each once")
    return tuple(name for name in NAMES if name in groups)


@validated
def write_columns(plan: Plan, path: PathName, columns: Sequence[str] = ALL, rate: Positive = 100.0) -> None:
    """Write a plan's columns at `rate` and at its end, with all digits, so that they are read back exactly.

    Without a vehicle, the columns that follow from one are left out. The path between rows is lost. Raises
    SpecError for unknown groups, where no column is left, and where the file cannot be written.

    Args:
        plan: The plan to write.
        path: The file.
        columns: Groups of NAMES, or PAPER.
        rate: Rows a second [1/s].
    """
    wanted = column_groups(",".join(columns))
    if wanted == PAPER:
        write_csv(plan.trajectory, path, rate)
        return
    write_whole(path, columns_text(plan, wanted, rate))


def columns_text(plan: Plan, columns: Sequence[str], rate: float) -> str:
    """Return the table that `write_columns` writes. Raises SpecError where no column is left."""
    times = plan.trajectory.sample(rate)
    groups: dict[str, Array] = {"time": times[:, None]}
    groups |= {name: plan.trajectory.evaluate(times, k) for k, name in enumerate(PATH)}
    if plan.vehicle is not None:
        found = reference(plan, times=times)
        groups["attitude"] = found.setpoint.q_world_body
        groups["rates"] = found.setpoint.omega_body
        groups["thrusts"] = found.rotor_thrusts
    written = [name for name in columns if name in groups]
    if not written:
        raise SpecError(f"{' and '.join(columns)} follow from a vehicle, and the plan has none; plan for one")
    header = [column for name in written for column in _header(name, groups[name].shape[1])]
    rows = np.concatenate([groups[name] for name in written], axis=1)
    return csv_text([header, *rows.tolist()])


def _header(group: str, count: int) -> Sequence[str]:
    return NAMES[group] or [f"f{rotor}" for rotor in range(count)]
