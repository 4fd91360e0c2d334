"""Maneuvers, one file each; a new one is a file and a line here."""

from aerobat.problem.maneuvers.course import Course
from aerobat.problem.maneuvers.custom import CustomManeuver
from aerobat.problem.maneuvers.elements import Hold, PassGate, PassWaypoint
from aerobat.problem.maneuvers.figures import (
    BarrelRoll,
    Corkscrew,
    Figure,
    Immelmann,
    InvertedPass,
    KnifeEdgePass,
    MattyFlip,
    PowerLoop,
    SplitS,
)
from aerobat.problem.maneuvers.flip import Flip
from aerobat.problem.maneuvers.gate_passage import GatePassage
from aerobat.problem.maneuvers.half_flip import HalfFlip
from aerobat.problem.maneuvers.line import Line
from aerobat.problem.maneuvers.maneuver import MANEUVERS, Maneuver, maneuver, registered_maneuvers
from aerobat.problem.maneuvers.waypoints import Waypoint, Waypoints

__all__ = [
    "MANEUVERS",
    "BarrelRoll",
    "Corkscrew",
    "Course",
    "CustomManeuver",
    "Figure",
    "Flip",
    "GatePassage",
    "HalfFlip",
    "Hold",
    "Immelmann",
    "InvertedPass",
    "KnifeEdgePass",
    "Line",
    "Maneuver",
    "MattyFlip",
    "PassGate",
    "PassWaypoint",
    "PowerLoop",
    "SplitS",
    "Waypoint",
    "Waypoints",
    "maneuver",
    "registered_maneuvers",
]
