"""Numerical optimization that knows no robots: convex QPs with stages, each assigned to one slot."""

from aerobat.optimization.assignment import AssignmentProgram, AssignmentResult, SlottedStage
from aerobat.optimization.backends import BACKENDS, Solver, available, solver

__all__ = [
    "BACKENDS",
    "AssignmentProgram",
    "AssignmentResult",
    "SlottedStage",
    "Solver",
    "available",
    "solver",
]
