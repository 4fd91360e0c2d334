"""Problem → plan: the planners, the search on durations, and the rotors' margin."""

from aerobat.planning.feasibility import RotorMargin, rotor_margin
from aerobat.planning.miqp import Miqp
from aerobat.planning.optimal_control.time_optimal import TimeOptimal
from aerobat.planning.planner import Planner, plan
from aerobat.planning.polynomials.free_knots import FreeKnots
from aerobat.planning.polynomials.min_snap import MinSnap, Stretch
from aerobat.planning.proof import proven
from aerobat.planning.result import Attempt, PlacedStage, Plan
from aerobat.planning.search import Bisection, Grid

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
