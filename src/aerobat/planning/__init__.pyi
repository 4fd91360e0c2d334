from .feasibility import RotorMargin, rotor_margin
from .miqp import Miqp
from .planner import Planner, plan
from .polynomial.free_knots import FreeKnots
from .polynomial.min_snap import MinSnap, Stretch
from .proof import proven
from .result import Attempt, PlacedStage, Plan
from .search import Bisection, Grid
from .time_optimal.time_optimal import TimeOptimal

__all__ = [
    "Attempt",
    "Bisection",
    "FreeKnots",
    "Grid",
    "MinSnap",
    "Miqp",
    "PlacedStage",
    "Plan",
    "Planner",
    "RotorMargin",
    "Stretch",
    "TimeOptimal",
    "plan",
    "proven",
    "rotor_margin",
]
