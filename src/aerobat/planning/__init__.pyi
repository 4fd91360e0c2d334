from .assessment.assessment import Assessment, PositionRange, SecondOpinion
from .assessment.lower_bound import least_duration
from .certified_solve import Judged, Solution, certified_solve
from .evidence import Evidence
from .flyability import FLYABLE_ERROR, FlownPassage, Flyability, OwnFlight, nominal_flight, own_flight
from .miqp.miqp import Miqp
from .passages import PlacedStage, planned_passages, planned_waypoints
from .planners import (
    Planner,
    PlannerOption,
    as_planner,
    command_settings,
    option,
    plan,
    planner,
    planner_class,
    planner_for,
    planner_options,
    registered_planners,
    suited_planner,
)
from .polynomial.free_knots import FreeKnots
from .polynomial.min_snap import MinSnap, TimeScaling
from .recorder import Attempt, Recorder
from .result import Plan, load_plan
from .rotor_margin import RotorMargin
from .search import BisectionSearch, GridSearch
from .second_opinion import with_explanation, with_recoveries, with_second_opinion
from .time_optimal import TimeOptimal
from .tube import Tube

__all__ = [
    "FLYABLE_ERROR",
    "Assessment",
    "Attempt",
    "BisectionSearch",
    "Evidence",
    "FlownPassage",
    "Flyability",
    "FreeKnots",
    "GridSearch",
    "Judged",
    "MinSnap",
    "Miqp",
    "OwnFlight",
    "PlacedStage",
    "Plan",
    "Planner",
    "PlannerOption",
    "PositionRange",
    "Recorder",
    "RotorMargin",
    "SecondOpinion",
    "Solution",
    "TimeOptimal",
    "TimeScaling",
    "Tube",
    "as_planner",
    "certified_solve",
    "command_settings",
    "least_duration",
    "load_plan",
    "nominal_flight",
    "option",
    "own_flight",
    "plan",
    "planned_passages",
    "planned_waypoints",
    "planner",
    "planner_class",
    "planner_for",
    "planner_options",
    "registered_planners",
    "suited_planner",
    "with_explanation",
    "with_recoveries",
    "with_second_opinion",
]
