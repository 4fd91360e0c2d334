"""Tables of numbers in text files: lines of numbers with commas between, below a header or without one."""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping, Sequence

import numpy as np

from aerobat.arrays import Array
from aerobat.errors import SpecError

NAMES: Mapping[str, tuple[str, ...]] = {  # of columns, by groups
    "time": ("t",),
    "position": ("x", "y", "z"),
    "velocity": ("vx", "vy", "vz"),
    "acceleration": ("ax", "ay", "az"),
    "jerk": ("jx", "jy", "jz"),
    "attitude": ("qw", "qx", "qy", "qz"),
    "rates": ("wx", "wy", "wz"),
    "thrusts": (),  # f0, f1, ..., one for each rotor
}
UNNAMED = "unnamed"  # the name of a column without one, such as the index of a data frame
SYNONYMS = {"time": "t", "time_s": "t", "px": "x", "py": "y", "pz": "z", "": UNNAMED}
MAX_ROWS = 2_000_000  # five hours at 100 Hz, half an hour at 1 kHz
MAX_COLUMNS = 1000


def has_header(text: str) -> bool:
    """Return True if a file's first line names columns and has no numbers."""
    first = text.partition("\n")[0].strip().lstrip("#")
    # of more columns, the last part is no identifier
    words = [word.strip().strip('"') for word in first.split(",", MAX_COLUMNS)]
    return any(words) and all((word or UNNAMED).isidentifier() and not _is_number(word) for word in words)


def require_numbers(text: str) -> None:
    """Raise SpecError for a first line that has neither numbers nor names of columns."""
    first = text.partition("\n")[0].strip()
    is_table = first.count(",") < MAX_COLUMNS
    if first and is_table and not any(map(_is_number, first.split(","))):
        raise SpecError(
            f"line 1 is neither numbers nor names of columns, got {first[:60]!r}; name them t,x,y,z and so "
            "on, without units, commas between"
        )


def named_columns(text: str, needed: Sequence[str], remedy: str) -> dict[str, Array]:
    """Return the columns of a table with a header by their names, in small letters and without synonyms.

    Raises SpecError, naming the line or the column, for a text without such a table.

    Args:
        text: The text of the file.
        needed: The names of required columns.
        remedy: The end of the message where one is missing, without a full stop.
    """
    words = text.partition("\n")[0].strip().lstrip("#").split(",")
    header = [SYNONYMS.get(name, name) for name in (word.strip().strip('"').lower() for word in words)]
    for name in header:
        if header.count(name) > 1:
            raise SpecError(f"line 1: there are two columns {name}; rename one")
    for name in needed:
        if name not in header:
            raise SpecError(f"line 1: there is no column {name}; {remedy}")
    table = number_table(text, 2, (len(header),), f"line 1 names {len(header)} columns")
    return dict(zip(header, table.T, strict=True))


def number_table(text: str, first: int, counts: Sequence[int], expected: str) -> Array:
    """Return the numbers of a file's lines, (rows, columns), of two rows or more.

    Raises SpecError, naming the line, for a text without such a table.

    Args:
        text: The text of the file.
        first: The number of the first line of the table, counted from 1.
        counts: The allowed numbers of columns.
        expected: The end of the message for other numbers, without a full stop.
    """
    if text.count("\n") > MAX_ROWS:
        raise SpecError(f"it has more than {MAX_ROWS} lines; give the part that is a path's")
    lines = text.splitlines()[first - 1 :]
    while len(lines) > 1 and not lines[-1].strip():
        lines.pop()
    if len(lines) > 1 and not text.endswith("\n"):
        raise SpecError(f"line {first - 1 + len(lines)} is cut off, it has no line end")
    width = lines[0].count(",") + 1 if lines else 0
    values = array("d")
    for number, line in enumerate(lines, first):
        found = line.count(",") + 1
        if found not in counts:
            raise SpecError(f"line {number} has {found} numbers, {expected}")
        if found != width:
            raise SpecError(f"line {number} has {found} numbers, line {first} has {width}")
        values.extend(_numbers(line, number))
    if len(lines) < 2:
        raise SpecError(f"a trajectory needs at least two lines of numbers, got {len(lines)}")
    return np.array(values).reshape(len(lines), width)


def _numbers(line: str, number: int) -> list[float]:
    try:
        row = [float(word) for word in line.split(",")]
    except ValueError:
        raise SpecError(f"line {number} must be numbers with commas between, got {line[:60]!r}") from None
    if not all(map(math.isfinite, row)):
        raise SpecError(f"line {number} must have finite numbers only, got {line[:60]!r}")
    return row


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
