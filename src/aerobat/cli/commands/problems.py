"""`aerobat problems`: what there is to plan, and files to begin one's own with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from aerobat.cli.options import output
from aerobat.cli.runs.new_file import write_new
from aerobat.errors import SpecError
from aerobat.problem import load_problem, problem_names, problem_text
from aerobat.reporting.facts import Fact, Facts
from aerobat.reporting.tables import print_table, table


def problems(
    problem: str | None = None, /, *, out: Annotated[Path | None, Parameter(group=output)] = None
) -> None:
    """List the built-in problems; of one that is named, print the file, to begin one's own with.

    aerobat problems flip-roll --out mine.toml       a built-in one, with the reasons for its numbers
    aerobat problems mine.toml                       your own, as it was understood

    Parameters
    ----------
    problem
        A name that is listed, or a problem's TOML file.
    out
        The file to write instead of printing; it must not be there yet.
    """
    if problem is not None and out is not None:
        write_new(problem_text(problem), out)
    elif problem is not None:
        print(problem_text(problem), end="")
    elif out is not None:
        raise SpecError("--out writes one problem; name it")
    else:
        print_table(
            table(Facts([Fact("problems", [load_problem(name) for name in problem_names()], "problems")]))
        )
