"""Trajectories as CSV in the layout of the paper's reference code, and back; tables with a header, too.

The layout is that of `fliptraj.csv`: no header, and comma-separated rows of twelve numbers at a fixed rate,
there 100 Hz: position, velocity, acceleration and jerk (x, y, z each, SI units, world axes). The reference
code drops the rest of a segment that is no whole number of periods. Here the last row is always the end of
the trajectory. Where the last step is shorter than a period, every row has its time [s] as a thirteenth
number. The reference code reads both, as it takes the first twelve columns.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aerobat.declaration import PathName, Positive, validated
from aerobat.documents import read_text, within
from aerobat.errors import SpecError
from aerobat.interchange.number_table import has_header, number_table, require_numbers
from aerobat.interchange.rows import PathRows, rows_of_columns, times_at_rate
from aerobat.interchange.tables import csv_text
from aerobat.storage import write_whole
from aerobat.trajectory import Carrier, Trajectory, as_trajectory

CSV_COLUMNS = 12
MAX_CSV = 2**27  # bytes: an hour and a half at 100 Hz


@validated
def write_csv(trajectory: Trajectory | Carrier, path: PathName, rate: Positive = 100.0) -> None:
    """Write rows of p, v, a, j at `rate` [1/s] and at the end, with all digits, so that they are read back.

    A row at a knot belongs to the later segment. The file appears whole or not at all. Raises SpecError for a
    rate that is not positive, and where the file cannot be written.
    """
    trajectory = as_trajectory(trajectory)
    times = trajectory.sample(rate)
    rows = np.concatenate([trajectory.evaluate(times, k) for k in range(4)], axis=1)
    if abs(times[-1] - (len(times) - 1) / rate) > 1e-12:  # [s] the last step is shorter
        rows = np.column_stack([rows, times])
    write_whole(path, csv_text(rows.tolist()))


@validated
def read_csv(path: PathName, rate: Positive = 100.0) -> Trajectory:
    """Return the trajectory through p, v, a, j of all rows, which are at `rate` [1/s] unless times are given.

    Between rows, it differs from the written trajectory by the error of interpolation. A file whose first
    line names its columns, x, y and z among them, is read by these names, see `columns`. Where velocity,
    acceleration or jerk is missing, the path is that of minimum snap through the given columns. Raises
    SpecError, naming the line, for rows that are not 12 or 13 finite numbers, with rising times from 0.
    """
    return read_rows(path, rate).trajectory


@validated
def read_rows(path: PathName, rate: Positive = 100.0) -> PathRows:
    """Return the rows of which `read_csv` makes a trajectory. Raises SpecError as `read_csv` does."""
    with within(f"{path}: "):
        text = read_text(Path(path), MAX_CSV)
        rows = rows_of_columns(text, rate) if has_header(text) else _bare_rows(text, rate)
        _ = rows.trajectory
    return rows


def _bare_rows(text: str, rate: float) -> PathRows:
    require_numbers(text)
    expected = f"a path's have {CSV_COLUMNS}, or {CSV_COLUMNS + 1} with a time"
    rows = number_table(text, 1, (CSV_COLUMNS, CSV_COLUMNS + 1), expected)
    timed = rows.shape[1] > CSV_COLUMNS
    times = rows[:, CSV_COLUMNS] if timed else times_at_rate(len(rows), rate)
    steps = np.diff(times)
    if times[0] != 0 or not (steps > 0).all():
        line = 1 if times[0] != 0 else 2 + int(np.argmax(steps <= 0))
        raise SpecError(f"line {line}: times, the thirteenth numbers, must start at 0 and rise")
    return PathRows(rows[:, :CSV_COLUMNS].reshape(-1, 4, 3), steps, timed=timed)
