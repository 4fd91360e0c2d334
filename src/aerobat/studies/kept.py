"""Finished parts of a study in a folder, from which one that was ended goes on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerobat.declaration import PathName
from aerobat.documents import read_json
from aerobat.errors import SpecError
from aerobat.provenance import installed_versions
from aerobat.storage import digest_of, read_arrays, whole_file, write_whole
from aerobat.studies.workers import LIBRARIES

FINGERPRINT = "fingerprint.json"


@dataclass(frozen=True)
class KeptParts:
    """The folder of a study's finished parts, each a file of arrays that is whole or absent.

    Without a folder, nothing is kept and nothing is found.
    """

    folder: Path | None

    @classmethod
    def of(
        cls, folder: PathName | None, what: tuple[str, str], asked: Callable[[], Mapping[str, Any]]
    ) -> KeptParts:
        """The folder, new or of the same study.

        Args:
            folder: Where parts are kept, if they are.
            what: What the parts are called, and the study.
            asked: Tells all that their numbers depend on, in few words; workers are not among it.

        Raises SpecError, one sentence, for a folder of any other study.
        """
        if folder is None:
            return cls(None)
        folder, (parts, study) = Path(folder), what
        own = {"format": f"aerobat-{study}-1", **asked(), "versions": installed_versions(LIBRARIES)}
        path = folder / FINGERPRINT
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

    def read(self, name: str) -> dict[str, NDArray[Any]] | None:
        """A finished part; None where there is none, or none as it was kept."""
        if self.folder is None:
            return None
        try:
            arrays = read_arrays(self.folder / f"{name}.npz", "part")
            return arrays if str(arrays.pop("digest")) == digest_of(arrays) else None
        except (SpecError, KeyError):
            return None

    def write(self, name: str, arrays: Mapping[str, Any]) -> None:
        """Keep a finished part, where there is a folder."""
        if self.folder is None:
            return
        with whole_file(self.folder / f"{name}.npz") as temporary, temporary.open("wb") as file:
            np.savez(file, **arrays, digest=digest_of(arrays))


def names_of_parts(folder: Path) -> list[str]:
    """Return the names of the parts that a folder keeps."""
    return [path.stem for path in folder.glob("*.npz")]


def fingerprint(table: Any) -> str:
    """Return a few letters that tell one table, as files hold it, from all others."""
    return hashlib.sha256(json.dumps(table, sort_keys=True).encode()).hexdigest()[:16]
