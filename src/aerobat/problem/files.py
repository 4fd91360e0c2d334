"""Problems from TOML and back; the built-in ones are such files too."""

from __future__ import annotations

from importlib.resources import files

from aerobat.declaration import PathName, to_table, validated
from aerobat.documents import (
    document_names,
    preset_text,
    read_document,
    resolve_document,
    to_toml,
    write_document,
)
from aerobat.problem.problem import Problem

PRESETS = files("aerobat.problem") / "presets"


def problem_names() -> tuple[str, ...]:
    """Return the names of the built-in problems."""
    return document_names(PRESETS)


@validated
def load_problem(name: PathName) -> Problem:
    """Return a built-in problem by its name, or the one in a TOML file.

    Raises SpecError, in one sentence that names the field, when there is no such problem or it is malformed.
    """
    path = resolve_document(name, PRESETS, "problem")
    return read_document(path, Problem, "problem", name=path.name.removesuffix(".toml"))


def as_problem(problem: Problem | str) -> Problem:
    """The problem, of itself or of what `load_problem` takes. Raises SpecError as that does."""
    return load_problem(problem) if isinstance(problem, str) else problem


@validated
def problem_text(name: PathName) -> str:
    """Return the text of a problem's file: a preset's own, or one's own as it was understood.

    Raises SpecError as `load_problem` does.
    """
    return preset_text(name, PRESETS) or to_toml(to_table(load_problem(name)))


@validated
def write_problem(problem: Problem | str, path: PathName) -> None:
    """Write a problem as TOML, whole or not at all. Raises SpecError when the file cannot be written."""
    write_document(path, to_table(as_problem(problem)))
