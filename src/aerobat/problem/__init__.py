"""What is wanted: gates, maneuvers as lists of stages, problems. No optimization happens here."""

from aerobat.problem.ball import Ball
from aerobat.problem.condition import Attitude, Condition, ForceBalance, LinearBound, Quantity
from aerobat.problem.files import as_problem, load_problem, problem_names, write_problem
from aerobat.problem.gate import Gate, tilted_gate
from aerobat.problem.maneuvers import (
    CustomManeuver,
    Flip,
    GatePassage,
    HalfFlip,
    Line,
    Maneuver,
    Waypoint,
    Waypoints,
    maneuver,
    registered_maneuvers,
)
from aerobat.problem.problem import PAPER_LIMITS, EndState, Limits, Problem, at_rest
from aerobat.problem.stage import Stage, StageSequence

__all__ = [
    "PAPER_LIMITS",
    "Attitude",
    "Ball",
    "Condition",
    "CustomManeuver",
    "EndState",
    "Flip",
    "ForceBalance",
    "Gate",
    "GatePassage",
    "HalfFlip",
    "Limits",
    "Line",
    "LinearBound",
    "Maneuver",
    "Problem",
    "Quantity",
    "Stage",
    "StageSequence",
    "Waypoint",
    "Waypoints",
    "as_problem",
    "at_rest",
    "load_problem",
    "maneuver",
    "problem_names",
    "registered_maneuvers",
    "tilted_gate",
    "write_problem",
]
