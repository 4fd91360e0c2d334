"""Numerical optimization without robotics: convex QPs with stages, each assigned to one slot."""

from aerobat.optimization.assignment import AssignmentProgram as AssignmentProgram
from aerobat.optimization.assignment import SlottedStage as SlottedStage
from aerobat.optimization.backends import BACKENDS as BACKENDS
from aerobat.optimization.backends import Solver as Solver
from aerobat.optimization.backends import available_backends as available_backends
from aerobat.optimization.backends import solver as solver
from aerobat.optimization.moving_window import evenly_spread as evenly_spread
from aerobat.optimization.moving_window import improved_in_windows as improved_in_windows
from aerobat.optimization.result import AssignmentResult as AssignmentResult
