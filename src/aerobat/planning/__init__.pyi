from .assessment.assess import with_assessment, with_explanation, with_second_opinion
from .assessment.assessment import Assessment, Box, SecondOpinion
from .assessment.lower_bound import least_duration
from .certified_solve import Judged, Solution, certified_solve, with_certificate
from .flyability import nominal_flight, own_flight, with_flyability, with_recoveries
from .miqp import Miqp
from .passages import planned_passages, planned_waypoints
from .plan_file import load_plan
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
    with_evidence,
)
from .polynomial.free_knots import FreeKnots
from .polynomial.min_snap import MinSnap, TimeScaling
from .recorder import Attempt, Recorder
from .result import FLYABLE_ERROR, FlownPassage, Flyability, OwnFlight, PlacedStage, Plan
from .rotor_margin import RotorMargin
from .search import BisectionSearch, GridSearch
from .time_optimal.time_optimal import TimeOptimal
from .tube import Tube

__all__ = [
    "FLYABLE_ERROR",
    "Assessment",
    "Attempt",
    "BisectionSearch",
    "Box",
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
    "with_assessment",
    "with_certificate",
    "with_evidence",
    "with_explanation",
    "with_flyability",
    "with_recoveries",
    "with_second_opinion",
]
