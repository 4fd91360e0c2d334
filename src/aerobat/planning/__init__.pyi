from .feasibility import RotorMargin, rotor_margin
from .miqp import Miqp
from .optimal_control.time_optimal import TimeOptimal
from .planner import Planner, plan
from .polynomials.free_knots import FreeKnots
from .polynomials.min_snap import MinSnap, Stretch
from .proof import proven
from .result import Attempt, PlacedStage, Plan
from .search import Bisection, Grid

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
