"""Finished parts of a study in a folder, from which an interrupted study is resumed."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from aerobat.declaration import PathName
from aerobat.documents import read_json
from aerobat.errors import SpecError
from aerobat.provenance import installed_versions
from aerobat.storage import digest_of, read_arrays, whole_file, write_whole
from aerobat.studies.workers import LIBRARIES

_FINGERPRINT = "fingerprint.json"  # the file that tells which study a folder belongs to
_PART = re.compile(r"(flights|cell)-.*\.npz")

Arrays = dict[str, NDArray[Any]]


class StoredPart(Protocol):
    """The result of a part that can be kept."""

    @property
    def arrays(self) -> Arrays:
        """The arrays that files keep of the result."""


Part = TypeVar("Part", bound=range | tuple[float, ...])  # flights of a sweep, or the values of a map's cell
Found = TypeVar("Found", bound=StoredPart)


@dataclass(frozen=True)
class KeptParts:
    """The folder of a study's finished parts, each a file of arrays that is written whole or not at all.

    Without a folder, nothing is kept and nothing is found.
    """

    folder: Path | None

    @classmethod
    def of(
        cls, folder: PathName | None, parts: str, study: str, inputs_summary: Callable[[], Mapping[str, Any]]
    ) -> KeptParts:
        """Return the folder, which is new or belongs to the same study.

        Args:
            folder: Where parts are kept; None to keep none.
            parts: The word for the parts, for messages.
            study: The word for the study, for messages and for the format.
            inputs_summary: Returns a summary of everything that the parts' numbers depend on.

        Raises SpecError, one sentence, for a folder of any other study.
        """
        if folder is None:
            return cls(None)
        folder = Path(folder)
        own = {"format": f"aerobat-{study}-1", **inputs_summary(), "versions": installed_versions(LIBRARIES)}
        path = folder / _FINGERPRINT
        try:
            is_new = not folder.exists() or not any(folder.iterdir())
        except OSError as error:
            raise SpecError(f"cannot keep {parts} in {folder}: {error.strerror or error}") from None
        if is_new:
            write_whole(path, json.dumps(own, indent=2) + "\n")
            return cls(folder)
        try:
            found = read_json(path)
            differing = [key for key in own if found[key] != own[key]]
        except (SpecError, KeyError, TypeError):
            raise SpecError(f"{folder}/ keeps no {parts} of a {study}; name a folder of its own") from None
        if differing:
            others = " and ".join(differing)
            raise SpecError(f"{folder}/ keeps {parts} of another {study} ({others}); remove it to begin anew")
        return cls(folder)

    def known(
        self, parts: Iterable[Part], restored: Callable[[Part, Arrays], Found | None]
    ) -> dict[Part, Found]:
        """Return the results of finished parts. `restored` makes one of its arrays, or None of others."""
        arrays = {part: self.read(part) for part in parts}
        found = {part: restored(part, own) for part, own in arrays.items() if own is not None}
        return {part: result for part, result in found.items() if result is not None}

    def keeping(self, results: Iterable[tuple[Part, Found]]) -> Iterator[tuple[Part, Found]]:
        """Yield parts with their results, each after it is kept, if there is a folder."""
        for part, result in results:
            self.write(part, result.arrays)
            yield part, result

    def read(self, part: range | Sequence[float]) -> Arrays | None:
        """Return the arrays of a finished part; None where there is none, or the file is damaged."""
        if self.folder is None:
            return None
        try:
            arrays = read_arrays(self.folder / _file_name(part), "part")
            return arrays if str(arrays.pop("digest")) == digest_of(arrays) else None
        except (SpecError, KeyError):
            return None

    def write(self, part: range | Sequence[float], arrays: Mapping[str, Any]) -> None:
        """Keep a finished part, if there is a folder."""
        if self.folder is None:
            return
        with whole_file(self.folder / _file_name(part)) as temporary, temporary.open("wb") as file:
            np.savez(file, **arrays, digest=digest_of(arrays))


def _file_name(part: range | Sequence[float]) -> str:
    """Return the name of the file that holds these flights of a sweep, or a map's cell at these values."""
    words = ["flights", part.start, part.stop] if isinstance(part, range) else ["cell", *part]
    return f"{'-'.join(map(str, words))}.npz"


def kept_parts(folder: Path, parts: Iterable[Part]) -> list[Part]:
    """Return the parts that a folder keeps."""
    names = {path.name for path in folder.glob("*.npz")}
    return [part for part in parts if _file_name(part) in names] if names else []


def is_kept_file(name: str) -> bool:
    """Return True for the name of a file that a study keeps."""
    return name == _FINGERPRINT or _PART.fullmatch(name) is not None


def fingerprint(table: Any) -> str:
    """Return a short hash that identifies a table."""
    return hashlib.sha256(json.dumps(table, sort_keys=True).encode()).hexdigest()[:16]
