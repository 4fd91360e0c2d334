"""What is wanted: gates, maneuvers as lists of stages, problems. No optimization happens here."""

from aerobat.specs.files import load_problem, problem_names, write_problem
from aerobat.specs.gate import Gate, tilted_gate
from aerobat.specs.maneuver import Flip, HalfFlip, Line, Maneuver, Passing, Staged
from aerobat.specs.problem import PAPER_LIMITS, EndState, Limits, Problem, rest
from aerobat.specs.stage import Condition, Course, Quantity, Stage
from aerobat.specs.waypoints import Waypoint, Waypoints

__all__ = [
    "PAPER_LIMITS",
    "Condition",
    "Course",
    "EndState",
    "Flip",
    "Gate",
    "HalfFlip",
    "Limits",
    "Line",
    "Maneuver",
    "Passing",
    "Problem",
    "Quantity",
    "Stage",
    "Staged",
    "Waypoint",
    "Waypoints",
    "load_problem",
    "problem_names",
    "rest",
    "tilted_gate",
    "write_problem",
]
