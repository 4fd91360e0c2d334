from .certification import Certificate, Envelope, certify
from .declaration import import_plugin
from .environment import Environment
from .errors import AerobatError, BackendMissing, Infeasible, SpecError
from .flatness import Reference, reference
from .flight import Flight, load_flight
from .flying import fly
from .interchange.csv import read_csv, write_csv
from .interchange.read import read_trajectory
from .kernels.controller import Controller
from .metrics import Score, score
from .planning import (
    Bisection,
    FreeKnots,
    Grid,
    MinSnap,
    Miqp,
    Plan,
    RotorMargin,
    Stretch,
    TimeOptimal,
    plan,
    rotor_margin,
)
from .problem import (
    Condition,
    CustomManeuver,
    EndState,
    Flip,
    Gate,
    GatePassage,
    HalfFlip,
    Limits,
    Line,
    Maneuver,
    Problem,
    Quantity,
    Stage,
    Waypoint,
    Waypoints,
    at_rest,
    load_problem,
    maneuver,
    problem_names,
    registered_maneuvers,
    tilted_gate,
    write_problem,
)
from .reporting.comparison import comparison_figure
from .reporting.figures import draw
from .reporting.tracking import tracking_figure
from .sensitivity import Gradient, Sensitivity, gradient
from .simulation import StateNoise
from .states import BodyState, FlatState, Setpoint, Wrench
from .studies.compare import Comparison, compare
from .trajectory import ContinuityRule, Trajectory, load_trajectory, minimum_effort, save_trajectory
from .vehicle import Rotor, Vehicle, load_vehicle, vehicle_names, write_vehicle

__all__ = [
    "AerobatError",
    "BackendMissing",
    "Bisection",
    "BodyState",
    "Certificate",
    "Comparison",
    "Condition",
    "ContinuityRule",
    "Controller",
    "CustomManeuver",
    "EndState",
    "Envelope",
    "Environment",
    "FlatState",
    "Flight",
    "Flip",
    "FreeKnots",
    "Gate",
    "GatePassage",
    "Gradient",
    "Grid",
    "HalfFlip",
    "Infeasible",
    "Limits",
    "Line",
    "Maneuver",
    "MinSnap",
    "Miqp",
    "Plan",
    "Problem",
    "Quantity",
    "Reference",
    "Rotor",
    "RotorMargin",
    "Score",
    "Sensitivity",
    "Setpoint",
    "SpecError",
    "Stage",
    "StateNoise",
    "Stretch",
    "TimeOptimal",
    "Trajectory",
    "Vehicle",
    "Waypoint",
    "Waypoints",
    "Wrench",
    "at_rest",
    "certify",
    "compare",
    "comparison_figure",
    "draw",
    "fly",
    "gradient",
    "import_plugin",
    "load_flight",
    "load_problem",
    "load_trajectory",
    "load_vehicle",
    "maneuver",
    "minimum_effort",
    "plan",
    "problem_names",
    "read_csv",
    "read_trajectory",
    "reference",
    "registered_maneuvers",
    "rotor_margin",
    "save_trajectory",
    "score",
    "tilted_gate",
    "tracking_figure",
    "vehicle_names",
    "write_csv",
    "write_problem",
    "write_vehicle",
]
