"""What is wanted: gates, maneuvers as lists of stages, problems. No optimization happens here."""

from aerobat.problem.files import load_problem, problem_names, write_problem
from aerobat.problem.gate import Gate, tilted_gate
from aerobat.problem.maneuver import Flip, HalfFlip, Line, Maneuver, Passing, Staged
from aerobat.problem.problem import PAPER_LIMITS, EndState, Limits, Problem, rest
from aerobat.problem.stage import Condition, Course, Quantity, Stage
from aerobat.problem.waypoints import Waypoint, Waypoints

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
