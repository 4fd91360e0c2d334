from .feasibility import RotorMargin, rotor_margin
from .miqp import Miqp
from .planner import Planner, plan
from .polynomial.free_knots import FreeKnots
from .polynomial.min_snap import MinSnap, TimeScaling
from .proof import with_certificate
from .result import Attempt, PlacedStage, Plan
from .search import BisectionSearch, GridSearch
from .time_optimal.time_optimal import TimeOptimal

__all__ = [
    "Attempt",
    "BisectionSearch",
    "FreeKnots",
    "GridSearch",
    "MinSnap",
    "Miqp",
    "PlacedStage",
    "Plan",
    "Planner",
    "RotorMargin",
    "TimeOptimal",
    "TimeScaling",
    "plan",
    "rotor_margin",
    "with_certificate",
]
