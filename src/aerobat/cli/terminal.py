"""Standard streams that may be closed, full, or without characters beyond ASCII."""

from __future__ import annotations

import codecs
import io
import json
import os
import sys
import unicodedata
from contextlib import suppress
from pathlib import Path
from typing import TextIO

# replacements of other characters in tables and sentences, for terminals with ASCII alone
ASCII = {
    "·": "-",
    "–": "-",
    "…": "...",
    "°": " deg",
    "²": "^2",
    "³": "^3",
    "×": "x",
    "δ": "delta",
    "ω": "omega",
    "Σ": "sum of ",
    "∫": "integral of ",
    "≤": "<=",
    "≥": ">=",
    "→": "->",
    "‘": "'",
    "’": "'",
    "“": '"',
    "”": '"',
}
_ERRORS = "aerobat-in-ascii"  # the name of the error handler below


def provide_streams() -> None:
    """Open closed streams to the null device, and let each stream write any character.

    Otherwise the next file that is opened would get the closed descriptor, and printing would write to it.
    """
    for name, mode in (
        ("stdin", "r"),
        ("stdout", "w"),
        ("stderr", "w"),
    ):  # descriptors are given in this order
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
    codecs.register_error(_ERRORS, _in_ascii)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and codecs.lookup(stream.encoding).name != "utf-8":
            stream.reconfigure(errors=_ERRORS)


def discard(stream: TextIO) -> None:
    """Redirect a broken stream to the null device, with the rest of its buffer."""
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def is_broken(stream: TextIO) -> bool:
    """Return True if a stream cannot be written any more, after writing an empty line to it."""
    try:
        stream.write("\n")
        stream.flush()
    except OSError:
        return True
    return False


def say(sentence: str) -> None:
    """Print a sentence to standard error, on one line even with unprintable names; ignore a broken stream."""
    line = "".join(sign if sign.isprintable() else repr(sign)[1:-1] for sign in sentence)
    try:
        print(f"aerobat: {line}", file=sys.stderr, flush=True)
    except OSError:
        discard(sys.stderr)


def open_in_browser(place: Path | str) -> None:
    """Open a file or an address in the browser, or report that there is no browser."""
    import webbrowser  # not needed by most commands

    address = place if isinstance(place, str) else place.resolve().as_uri()
    if not webbrowser.open(address):
        say(f"no browser could be started; open {place} in one")


def print_json(text: str) -> None:
    """Print JSON; characters that standard output cannot write are escaped."""
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    if codecs.lookup(encoding).name != "utf-8":
        text = "".join(sign if sign.isascii() else json.dumps(sign)[1:-1] for sign in text)
    print(text)


def _in_ascii(error: UnicodeError) -> tuple[str, int]:
    """Return ASCII for characters that a codec cannot write: known ones, letters without accents, or "?"."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    signs = error.object[error.start : error.end]
    return "".join(ASCII.get(sign) or _without_accents(sign) for sign in signs), error.end


def _without_accents(sign: str) -> str:
    return unicodedata.normalize("NFKD", sign).encode("ascii", "ignore").decode() or "?"
