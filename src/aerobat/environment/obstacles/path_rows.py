"""Paths of obstacles that move, as rows or as the CSV files that hold them."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import Field, PlainValidator

from aerobat.arrays import Array
from aerobat.declaration import FieldError, finite
from aerobat.documents import read_named_file

MAX_FILE = 2**22  # bytes: some fifty thousand rows


def rows_of_path(value: Any) -> Array:
    """Return the rows of an obstacle's path, (k, 4), of a value or of the CSV file that it names."""
    if isinstance(value, str):
        lines = read_named_file(value, MAX_FILE).decode(errors="replace").splitlines()
        cells = [line.split(",") for line in lines if line.strip() and not line.lstrip().startswith("#")]
        if cells and cells[0][0].strip() == "t":  # a header
            del cells[0]
        try:
            value = [[float(cell) for cell in row] for row in cells]
        except ValueError:
            raise FieldError("", f": {value} has a row that is not four numbers; mend it") from None
    count = len(value) if hasattr(value, "__len__") else 1
    rows = finite(value, count, 4) if count else np.zeros((0, 4))
    if count and (len(rows) < 2 or not (np.diff(rows[:, 0]) > 0.0).all()):
        raise FieldError("", "must be two rows or more of t, x, y, z, the time rising from row to row")
    return rows


PathRows = Annotated[
    Array,
    PlainValidator(rows_of_path),
    Field(description="a CSV file's name, from the problem's folder, or rows of four numbers each"),
]
