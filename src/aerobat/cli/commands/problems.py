"""`aerobat problems`: what there is to plan."""

from __future__ import annotations

from aerobat.problem import load_problem, problem_names
from aerobat.reporting.tables import print_table, problems_table


def problems() -> None:
    """List the built-in problems."""
    print_table(problems_table(load_problem(name) for name in problem_names()))
