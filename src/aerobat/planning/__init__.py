"""Problem → plan: the paper's mixed-integer program, its search on dt, and the rotors' margin."""

from aerobat.planning.feasibility import RotorMargin, rotor_margin
from aerobat.planning.miqp import Miqp
from aerobat.planning.planner import Planner, plan
from aerobat.planning.result import Attempt, PlacedStage, Plan
from aerobat.planning.search import Bisection, Grid

__all__ = [
    "Attempt",
    "Bisection",
    "Grid",
    "Miqp",
    "PlacedStage",
    "Plan",
    "Planner",
    "RotorMargin",
    "plan",
    "rotor_margin",
]
