"""Conditions of flights from TOML files and back; the presets are such files too."""

from __future__ import annotations

from importlib.resources import files

from aerobat.declaration import PathName, to_table, validated
from aerobat.documents import Presets, write_document
from aerobat.environment.dispersion import Dispersion

CONDITIONS = Presets(Dispersion, "conditions", files("aerobat.environment") / "presets")


def dispersion_names() -> tuple[str, ...]:
    """Return the names of the conditions that come with Aerobat."""
    return CONDITIONS.names()


@validated
def load_dispersion(name_or_path: PathName) -> Dispersion:
    """Return conditions that come with Aerobat, by their name, or those in a TOML file, by its path.

    Raises SpecError, in one sentence that names the file and the field, when there are none such or the file
    is malformed.
    """
    return CONDITIONS.load(name_or_path)


def as_dispersion(dispersion: Dispersion | str) -> Dispersion:
    """The conditions, of themselves or of what `load_dispersion` takes. Raises SpecError as that does."""
    return load_dispersion(dispersion) if isinstance(dispersion, str) else dispersion


@validated
def write_dispersion(dispersion: Dispersion | str, path: PathName) -> None:
    """Write conditions as TOML, whole or not at all. Raises SpecError when the file cannot be written."""
    write_document(path, to_table(as_dispersion(dispersion)))
