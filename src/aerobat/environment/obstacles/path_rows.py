"""Paths of moving obstacles, given as rows or as CSV files."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import Field, PlainValidator

from aerobat.arrays import Array
from aerobat.declaration import FieldError, finite, shown
from aerobat.documents import read_named_file

MAX_FILE = 2**22  # bytes: some fifty thousand rows
COLUMNS = ["t", "x", "y", "z"]


def rows_of_path(value: Any) -> Array:
    """Return the rows of an obstacle's path, (k, 4), from a value or from the CSV file that it names."""
    path = _rows_of_file(value) if isinstance(value, str) else value
    if not hasattr(path, "__len__"):
        raise FieldError("", f"must be a CSV file's name or rows of t, x, y, z, got {shown(value)}")
    rows = finite(path, len(path), 4) if len(path) else np.zeros((0, 4))
    is_given = isinstance(value, str) or len(rows)
    if is_given and (len(rows) < 2 or not (np.diff(rows[:, 0]) > 0.0).all()):
        raise FieldError("", "must be two rows or more of t, x, y, z, the time rising from row to row")
    return rows


def _rows_of_file(name: str) -> list[list[float]]:
    """Return the rows of t, x, y, z in a file, whose header may name these columns in any order."""
    lines = read_named_file(name, MAX_FILE).decode("utf-8-sig", errors="replace").splitlines()
    lines = [line for line in lines if line.strip() and not line.lstrip().startswith("#")]
    cells = [[cell.strip(' "') for cell in line.split(",")] for line in lines]
    header = cells.pop(0) if cells and cells[0][0][:1].isalpha() else COLUMNS
    if not set(COLUMNS) <= set(header):
        raise FieldError("", f": {name} must have the columns t, x, y, z, got {shown(','.join(header))}")
    try:
        rows = [dict(zip(header, map(float, row), strict=True)) for row in cells]
    except ValueError:
        count = "four" if header is COLUMNS else len(header)
        raise FieldError("", f": {name} has a row that is not {count} numbers; mend it") from None
    return [[row[column] for column in COLUMNS] for row in rows]


PathRows = Annotated[
    Array,
    PlainValidator(rows_of_path),
    Field(description="a CSV file's name, from the problem's folder, or rows of four numbers each"),
]
