"""A file that a command writes to begin one's own with."""

from __future__ import annotations

from pathlib import Path

from aerobat.errors import SpecError
from aerobat.storage import write_whole


def write_new(text: str, out: Path) -> None:
    """Write a text to a file that is not there yet. Raises SpecError where there is one."""
    if out.exists():
        raise SpecError(f"--out {out} is there already; name a new file")
    write_whole(out, text)
