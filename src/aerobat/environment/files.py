"""Conditions of flights in TOML files; the presets are such files, too."""

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
    """Return the preset conditions of this name, or those in the TOML file at this path.

    SpecError, which names the file and the field, is raised where there are none or the file is malformed.
    """
    return CONDITIONS.load(name_or_path)


def as_dispersion(dispersion: Dispersion | str) -> Dispersion:
    """Return the conditions, loaded where a name or path is given. Raise SpecError as `load_dispersion`."""
    return load_dispersion(dispersion) if isinstance(dispersion, str) else dispersion


@validated
def write_dispersion(dispersion: Dispersion | str, path: PathName) -> None:
    """Write conditions as TOML, completely or not at all. Raise SpecError if the file cannot be written."""
    write_document(path, to_table(as_dispersion(dispersion)))
