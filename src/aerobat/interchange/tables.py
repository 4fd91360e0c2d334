"""Tables as files: CSV, or Parquet, which keeps the types of columns; both are read back equal."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerobat.declaration import PathName, validated
from aerobat.documents import in_document, read_text
from aerobat.errors import SpecError, import_extra
from aerobat.storage import whole_file, write_whole

CSV, PARQUET = ".csv", ".parquet"
MAX_TABLE = 2**28  # bytes: half a million flights
MAX_CELLS = MAX_TABLE // 8


@validated
def write_table(table: Mapping[str, Any], path: PathName) -> None:
    """Write columns by their names, as of a sweep's table, to a CSV or Parquet file, by the path's suffix.

    Columns are whole numbers, numbers or text; true and false are written as 1 and 0, and all numbers with
    all digits. Raises SpecError for another suffix, and where the file cannot be written, BackendMissing for
    Parquet without pyarrow.
    """
    columns = _columns(table)
    if _suffix(path) == CSV:
        rows = zip(*(column.tolist() for column in columns.values()), strict=True)
        write_whole(path, csv_text([columns, *rows]))
        return
    parquet = _parquet()
    from pyarrow import table as arrow_table

    made = arrow_table(
        {name: column.tolist() if column.dtype.kind == "U" else column for name, column in columns.items()}
    )
    with whole_file(path) as temporary:
        parquet.write_table(made, temporary)


@validated
def read_table(path: PathName) -> dict[str, NDArray[Any]]:
    """Return the columns that `write_table` wrote, by their names: whole numbers, numbers, or text.

    CSV has no types: a column of text is read as numbers where all of its entries are numbers in text.
    Raises SpecError, one sentence, for any other file, BackendMissing for Parquet without pyarrow.
    """
    with in_document(Path(path), "table"):
        if _suffix(path) == CSV:
            return _from_csv(read_text(Path(path), MAX_TABLE))
        return _from_parquet(Path(path))


def csv_text(rows: Iterable[Iterable[Any]]) -> str:
    """Return lines of numbers or text, separated by commas; numbers have all digits."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def require_writable(path: PathName) -> None:
    """Raise, before anything is flown, what `write_table` would raise for this path."""
    if _suffix(path) == PARQUET:
        _parquet()


def _suffix(path: PathName) -> str:
    suffix = Path(path).suffix
    if suffix not in (CSV, PARQUET):
        raise SpecError(f"a table's file ends in {CSV} or {PARQUET}, got {path}")
    return suffix


def _columns(table: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """Return the columns as arrays. Raises SpecError for values that are none."""
    try:
        columns = {str(name): np.asarray(column) for name, column in table.items()}
    except ValueError:  # ragged
        columns = {}
    shapes = {column.shape for column in columns.values()}
    kinds = {column.dtype.kind for column in columns.values()}
    if len(shapes) != 1 or len(shapes.pop()) != 1 or not kinds <= set("biufU"):
        raise SpecError("table must hold columns by their names: lists of numbers or text, all as long")
    return {name: column + 0 if column.dtype.kind == "b" else column for name, column in columns.items()}


def _parquet() -> Any:
    return import_extra("pyarrow.parquet", "Parquet files need pyarrow", "aerobat[parquet]", "write CSV")


def _from_parquet(path: Path) -> dict[str, NDArray[Any]]:
    parquet = _parquet()
    from pyarrow import ArrowException

    try:
        with parquet.ParquetFile(path) as file:
            if file.metadata.num_rows * file.metadata.num_columns > MAX_CELLS:
                raise SpecError(f"it has more than {MAX_CELLS} cells; read it by pyarrow")
            columns = file.read()
        return {name: np.array(columns.column(name).to_pylist()) for name in columns.column_names}
    except FileNotFoundError:
        raise SpecError("there is no such file; check the path") from None
    except SpecError:
        raise
    except (ArrowException, OSError, ValueError):
        raise SpecError("it is not a whole Parquet file; write it again") from None


def _from_csv(text: str) -> dict[str, NDArray[Any]]:
    try:
        header, *rows = csv.reader(io.StringIO(text, newline=""))
    except (ValueError, csv.Error):  # nothing at all, or no text
        header, rows = [], []
    if not header or len(set(header)) < len(header) or any(len(row) != len(header) for row in rows):
        raise SpecError("it is no table with a header and rows as long; write it again")
    return {name: _parsed([row[k] for row in rows]) for k, name in enumerate(header)}


def _parsed(column: Sequence[str]) -> NDArray[Any]:
    """Return whole numbers if all entries are such, else numbers if all are such, else text."""
    for kind in (int, float):
        try:
            return np.array([kind(text) for text in column])
        except ValueError:
            continue
    return np.array(column)
