from .ball import Ball
from .condition import Attitude, Condition, ForceBalance, LinearBound, Quantity
from .end_state import EndState, at_rest
from .files import as_problem, load_problem, problem_names, problem_text, write_problem
from .gate import Gate, tilted_gate
from .heading import Heading
from .limits import PAPER_LIMITS, Limits
from .maneuvers import (
    BarrelRoll,
    Corkscrew,
    Course,
    CustomManeuver,
    Figure,
    Flip,
    GatePassage,
    HalfFlip,
    Hold,
    Immelmann,
    InvertedPass,
    KnifeEdgePass,
    Line,
    Maneuver,
    MattyFlip,
    PassGate,
    PassWaypoint,
    PowerLoop,
    SplitS,
    Waypoint,
    Waypoints,
)
from .maneuvers.maneuver import maneuver, registered_maneuvers
from .planned_passage import PlannedPassage, PlannedWaypoint
from .problem import Problem
from .stage import Stage, StageSequence
from .tolerance import Tolerance
from .wall import Wall

__all__ = [
    "PAPER_LIMITS",
    "Attitude",
    "Ball",
    "BarrelRoll",
    "Condition",
    "Corkscrew",
    "Course",
    "CustomManeuver",
    "EndState",
    "Figure",
    "Flip",
    "ForceBalance",
    "Gate",
    "GatePassage",
    "HalfFlip",
    "Heading",
    "Hold",
    "Immelmann",
    "InvertedPass",
    "KnifeEdgePass",
    "Limits",
    "Line",
    "LinearBound",
    "Maneuver",
    "MattyFlip",
    "PassGate",
    "PassWaypoint",
    "PlannedPassage",
    "PlannedWaypoint",
    "PowerLoop",
    "Problem",
    "Quantity",
    "SplitS",
    "Stage",
    "StageSequence",
    "Tolerance",
    "Wall",
    "Waypoint",
    "Waypoints",
    "as_problem",
    "at_rest",
    "load_problem",
    "maneuver",
    "problem_names",
    "problem_text",
    "registered_maneuvers",
    "tilted_gate",
    "write_problem",
]
