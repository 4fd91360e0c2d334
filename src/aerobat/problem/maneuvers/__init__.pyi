from .course import Course
from .custom import CustomManeuver
from .elements import Hold, PassGate, PassWaypoint
from .figures import (
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
from .flip import Flip
from .gate_passage import GatePassage
from .half_flip import HalfFlip
from .line import Line
from .maneuver import MANEUVERS, Maneuver, registered_maneuvers
from .waypoints import Waypoint, Waypoints

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
    "registered_maneuvers",
]
