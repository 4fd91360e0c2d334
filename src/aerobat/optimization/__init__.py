"""Numerical optimization without robotics: convex QPs with stages, each assigned to one slot."""

from aerobat.optimization.assignment import AssignmentProgram, SlottedStage
from aerobat.optimization.backends import BACKENDS, Solver, available_backends, solver
from aerobat.optimization.moving_window import evenly_spread, improved_in_windows
from aerobat.optimization.result import AssignmentResult

__all__ = [
    "BACKENDS",
    "AssignmentProgram",
    "AssignmentResult",
    "SlottedStage",
    "Solver",
    "available_backends",
    "evenly_spread",
    "improved_in_windows",
    "solver",
]
