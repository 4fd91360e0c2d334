from .certified_solve import Judged, Solution, certified_solve, with_certificate
from .miqp import Miqp
from .plan_file import load_plan
from .planners import (
    Planner,
    PlannerOption,
    option,
    plan,
    planner,
    planner_class,
    planner_options,
    registered_planners,
)
from .polynomial.free_knots import FreeKnots
from .polynomial.min_snap import MinSnap, TimeScaling
from .recorder import Attempt, Recorder
from .result import PlacedStage, Plan
from .rotor_margin import RotorMargin
from .search import BisectionSearch, GridSearch
from .time_optimal.time_optimal import TimeOptimal

__all__ = [
    "Attempt",
    "BisectionSearch",
    "FreeKnots",
    "GridSearch",
    "Judged",
    "MinSnap",
    "Miqp",
    "PlacedStage",
    "Plan",
    "Planner",
    "PlannerOption",
    "Recorder",
    "RotorMargin",
    "Solution",
    "TimeOptimal",
    "TimeScaling",
    "certified_solve",
    "load_plan",
    "option",
    "plan",
    "planner",
    "planner_class",
    "planner_options",
    "registered_planners",
    "with_certificate",
]
