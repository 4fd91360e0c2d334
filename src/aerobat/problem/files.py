"""Problems from TOML files and back; the built-in problems are TOML files, too."""

from __future__ import annotations

from importlib.resources import files

from aerobat.declaration import PathName, to_table, validated
from aerobat.documents import Presets, write_document
from aerobat.problem.problem import Problem

PROBLEMS = Presets(Problem, "problem", files("aerobat.problem") / "presets")


def problem_names() -> tuple[str, ...]:
    """Return the names of the built-in problems."""
    return PROBLEMS.names()


@validated
def load_problem(name: PathName) -> Problem:
    """Return a built-in problem by its name, or the one in a TOML file.

    Raises SpecError, in one sentence that names the field, when there is no such problem or it is malformed.
    """
    return PROBLEMS.load(name)


def as_problem(problem: Problem | str) -> Problem:
    """Return the problem, given itself or an argument of `load_problem`. Raises SpecError as that does."""
    return load_problem(problem) if isinstance(problem, str) else problem


@validated
def write_problem(problem: Problem | str, path: PathName) -> None:
    """Write a problem as TOML, whole or not at all. Raises SpecError when the file cannot be written."""
    write_document(path, to_table(as_problem(problem)))
