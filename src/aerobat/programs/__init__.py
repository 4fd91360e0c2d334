"""Numerical optimization that knows no robots: convex QPs with stages, each assigned to one slot."""

from aerobat.programs.assignment import AssignmentProgram, AssignmentResult, SlottedStage
from aerobat.programs.backends import BACKENDS, Solver, available, solver

__all__ = [
    "BACKENDS",
    "AssignmentProgram",
    "AssignmentResult",
    "SlottedStage",
    "Solver",
    "available",
    "solver",
]
