"""A check of "infeasible" results by the exact search."""

from __future__ import annotations

from aerobat.optimization.assignment import AssignmentProgram
from aerobat.optimization.backends import solver
from aerobat.optimization.result import AssignmentResult


def confirmed(program: AssignmentProgram, result: AssignmentResult) -> AssignmentResult:
    """Return a general solver's result, with "infeasible" confirmed by the exact search.

    A solution can be verified by its residuals, but infeasibility cannot. Presolve and tolerances of general
    solvers are sometimes wrong (SCIP 10 reports feasible flips as infeasible). Where the exact search finds a
    solution, the result of the built-in solver is returned.
    """
    if result.status != "infeasible":
        return result
    exact = solver("builtin").solve(program)
    return result if exact.x is None else exact
