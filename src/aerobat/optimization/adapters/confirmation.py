"""No "infeasible" on one solver's word."""

from __future__ import annotations

from aerobat.optimization.assignment import AssignmentProgram
from aerobat.optimization.backends import solver
from aerobat.optimization.result import AssignmentResult


def confirmed(program: AssignmentProgram, result: AssignmentResult) -> AssignmentResult:
    """Return a general solver's result, "infeasible" only where the exact search has no solution either.

    A solution is verified by its residuals; that there is none would be believed on the solver's word, whose
    presolve and tolerances are sometimes wrong (SCIP 10 calls feasible flips infeasible). Where the exact
    search finds a solution its result is returned, as that of the built-in solver.
    """
    if result.status != "infeasible":
        return result
    exact = solver("builtin").solve(program)
    return result if exact.x is None else exact
