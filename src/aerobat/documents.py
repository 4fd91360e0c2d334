"""TOML documents (vehicles, problems): found, read and written; whatever is wrong becomes one sentence."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from aerobat.declaration import FieldError, from_table, shown, to_table, unknown_name
from aerobat.errors import SpecError
from aerobat.storage import read_whole, write_whole

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable

    Document = Path | Traversable

T = TypeVar("T")

MAX_DOCUMENT = 2**22  # bytes: twenty thousand waypoints
MAX_SENTENCE = 300  # letters
_UNREADABLE = {  # at which the parser of TOML takes gigabytes or minutes; no document has any such
    "a number of a thousand digits": re.compile(r"(?<![0-9A-Fa-f_])[0-9A-Fa-f_]{1000}"),
    "a key of a hundred parts": re.compile(r"(?<![\w\"'-])(?:[\w\"'-]++[ \t]*+\.[ \t]*+){100}"),
}
_FOLDER: ContextVar[Path] = ContextVar("_FOLDER", default=Path())  # of the document that is read
_NUMBERS = re.compile(r"\[\n((?:\s*[-+\w.]+,\n)+)\s*\]")  # a list of numbers, each on a line of its own


@dataclass(frozen=True)
class Presets(Generic[T]):
    """The documents of one kind that come with Aerobat, beside which users have files of their own."""

    cls: type[T]  # the declared class of what they describe; left out in a file, its `name` is the file's
    kind: str  # what errors call one, such as "vehicle"
    folder: Traversable  # with a file NAME.toml for each

    def names(self) -> tuple[str, ...]:
        """Return their names, sorted."""
        files = (entry.name for entry in self.folder.iterdir() if entry.name.endswith(".toml"))
        return tuple(sorted(name.removesuffix(".toml") for name in files))

    def load(self, name_or_path: str | os.PathLike[str]) -> T:
        """Return what one of them describes, or a file. Raises SpecError.

        A path object, or text that ends in .toml or has a folder in it, is the path of a file. Other text is
        a name, or else the path of a file or folder that there is; a folder is refused.
        """
        text = os.fspath(name_or_path)
        path: Document = Path(text)
        if isinstance(name_or_path, str) and not (text.endswith(".toml") or "/" in text or os.sep in text):
            known = self.names()
            if text in known:
                path = self.folder / f"{text}.toml"
            elif not os.path.exists(text):
                raise unknown_name(self.kind, text, known)
        return read_document(path, self.cls, self.kind, name=path.name.removesuffix(".toml"))

    def text(self, name_or_path: str | os.PathLike[str]) -> str:
        """Return the text of one of them as it stands, with its remarks, or of a file as it was read.

        Raises SpecError as `load` does.
        """
        if name_or_path in self.names():
            return (self.folder / f"{name_or_path}.toml").read_text(encoding="utf-8")
        return to_toml(to_table(self.load(name_or_path)))


def read_document(path: str | Document, cls: type[T], kind: str, **defaults: Any) -> T:
    """Return what the TOML file `path` describes.

    Args:
        path: the file.
        cls: the declared class of what it describes.
        kind: what errors call it, such as "vehicle".
        **defaults: keys that the file may leave out.

    Raises:
        SpecError: one sentence that begins with the kind of document and its file, when the file cannot be
            read, is not TOML, or does not fit the declarations.
    """
    document = Path(path) if isinstance(path, str) else path
    folder = _FOLDER.set(document.parent if isinstance(document, Path) else Path())
    try:
        with in_document(document, kind):
            return from_table(cls, defaults | _parse(read_text(document)))
    finally:
        _FOLDER.reset(folder)


def file_name(value: Any) -> str:
    """Return a value that is the name of a file. Raises FieldError for others."""
    if not isinstance(value, str | os.PathLike) or not os.fspath(value):
        raise FieldError("", f"must be the path of a file, got {shown(value)}")
    return str(os.fspath(value))


def beside_document(path: str | os.PathLike[str]) -> Path:
    """Return a path that a document names, counted from the document's folder.

    Where no document is being read, it is counted from the working folder.
    """
    return _FOLDER.get() / path


def read_named_file(path: str | os.PathLike[str], max_size: int) -> bytes:
    """Return the content of a file that a document names, of at most `max_size` bytes.

    Raises FieldError, about the whole of a field, where it cannot be read.
    """
    if not str(path).isprintable():
        raise FieldError("", f"must be the name of a file, got {shown(path)}")
    try:
        return read_whole(beside_document(path), max_size)
    except SpecError as error:
        raise FieldError("", f": {beside_document(path)}: {error}") from None


def write_document(path: str | os.PathLike[str], table: Mapping[str, Any]) -> None:
    """Write `table` as a TOML file, whole or not at all. Raises SpecError when the file cannot be written."""
    write_whole(path, to_toml(table))


def to_toml(table: Mapping[str, Any]) -> str:
    """The text of a TOML file that holds `table`, lists of numbers on one line."""
    import tomli_w

    return _NUMBERS.sub(lambda found: f"[{' '.join(found[1].split()).rstrip(',')}]", tomli_w.dumps(table))


@contextmanager
def in_document(path: Document, kind: str) -> Iterator[None]:
    """Begin the message of any SpecError raised inside with the document it is about."""
    name = str(path) if isinstance(path, Path) else path.name
    with within(f"{kind} file {name if name.isprintable() else repr(name)}: "):
        yield


@contextmanager
def within(prefix: str) -> Iterator[None]:
    """Put `prefix` (such as "rotors[2].") before the message of any SpecError raised inside."""
    try:
        yield
    except SpecError as error:
        sentence = str(error)
        if len(sentence) > MAX_SENTENCE:  # with a name out of the document, which may be of any length
            sentence = sentence[:MAX_SENTENCE] + "..."
        raise SpecError(f"{prefix}{sentence}") from None


def read_text(path: Document, max_size: int = MAX_DOCUMENT) -> str:
    """A file's text of at most `max_size` bytes.

    Raises SpecError, one sentence without the file's name, where it cannot be read.
    """
    content = read_whole(path, max_size) if isinstance(path, Path) else path.read_bytes()
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise SpecError(f"byte {error.start} is not UTF-8 text; save the file as UTF-8") from None


def read_json(path: Path) -> Any:
    """Return what a JSON file holds. Raises SpecError, one sentence without the file's name, for no JSON."""
    try:
        return json.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise error if isinstance(error, SpecError) else SpecError("it is no JSON; write it again") from None


def _parse(text: str) -> dict[str, Any]:
    import tomllib

    for what, sign in _UNREADABLE.items():
        if found := sign.search(text):
            line = text.count("\n", 0, found.start()) + 1
            raise SpecError(f"this is not a TOML file that can be read: line {line} holds {what}")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise SpecError("this is not a TOML file that can be read: it nests too deeply") from None
    except ValueError as error:
        raise SpecError(f"this is not valid TOML: {error}") from None
