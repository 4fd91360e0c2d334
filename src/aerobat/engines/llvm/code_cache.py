"""A cache of machine code in files, so that each loop is compiled only once on a machine."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from importlib.resources import files
from pathlib import Path

from aerobat.errors import SpecError
from aerobat.storage import read_whole, write_whole

MAX_FILES = 256  # largest number of files; a loop takes 0.1 to 0.3 MB
MAX_SIZE = 2**24  # [bytes] largest size of a file
DIGEST_SIZE = hashlib.sha256().digest_size


def cached_code(listing: str, compiled: Callable[[], bytes]) -> bytes:
    """Return cached object code for a listing, or compile it and cache it.

    A folder that cannot be read or written, or a truncated file, only costs the time to compile.

    Args:
        listing: Everything that determines the code, except the compiler's sources, which are added.
        compiled: A function that compiles the listing.
    """
    path = _folder() / hashlib.sha256(f"{_compiler()}\n{listing}".encode()).hexdigest()
    with suppress(OSError, SpecError):
        content = read_whole(path, MAX_SIZE)
        digest, code = content[:DIGEST_SIZE], content[DIGEST_SIZE:]
        if hashlib.sha256(code).digest() == digest:
            os.utime(path)  # recently used files are kept longest
            return code
    code = compiled()
    with suppress(OSError, SpecError):
        write_whole(path, hashlib.sha256(code).digest() + code)
        _remove_oldest(path.parent)
    return code


def _folder() -> Path:
    """Return the folder of the user's cache."""
    from platformdirs import user_cache_path

    return user_cache_path("aerobat", appauthor=False) / "machine-code"


@lru_cache(maxsize=1)
def _compiler() -> str:
    """Return a digest of the sources that turn a listing into code."""
    sources = [
        (source.name, source.read_bytes())
        for room in ("aerobat.engines", "aerobat.engines.llvm")
        for source in files(room).iterdir()
        if source.name.endswith(".py")
    ]
    return hashlib.sha256(repr(sorted(sources)).encode()).hexdigest()


def _remove_oldest(folder: Path) -> None:
    """Remove all but the most recently used files."""
    by_age = sorted(folder.iterdir(), key=lambda path: path.stat().st_mtime)
    for path in by_age[:-MAX_FILES]:
        path.unlink(missing_ok=True)
