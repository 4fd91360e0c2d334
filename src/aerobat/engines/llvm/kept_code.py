"""Machine code kept in files: a loop is compiled once on a machine, whichever process asks for it again."""

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

MOST_KEPT = 256  # files; a loop takes 0.1 to 0.3 MB
MAX_SIZE = 2**24  # [bytes] of a file
DIGEST_SIZE = hashlib.sha256().digest_size


def kept_code(listing: str, compiled: Callable[[], bytes]) -> bytes:
    """Return object code that was compiled from the same listing before, or compile it and keep it.

    A folder that cannot be read or written, and a file that was cut short, only cost the time to compile.

    Args:
        listing: All that the code follows from but the compiler's sources, which are taken into account.
        compiled: Compiles the listing.
    """
    path = _folder() / hashlib.sha256(f"{_compiler()}\n{listing}".encode()).hexdigest()
    with suppress(OSError, SpecError):
        content = read_whole(path, MAX_SIZE)
        digest, code = content[:DIGEST_SIZE], content[DIGEST_SIZE:]
        if hashlib.sha256(code).digest() == digest:
            os.utime(path)  # files that are used are kept longest
            return code
    code = compiled()
    with suppress(OSError, SpecError):
        write_whole(path, hashlib.sha256(code).digest() + code)
        _remove_oldest(path.parent)
    return code


def _folder() -> Path:
    """Return the folder of the user's caches."""
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
    """Leave the files that were used last."""
    kept = sorted(folder.iterdir(), key=lambda path: path.stat().st_mtime)
    for path in kept[:-MOST_KEPT]:
        path.unlink(missing_ok=True)
