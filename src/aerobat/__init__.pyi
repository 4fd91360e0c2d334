from .errors import AerobatError, BackendMissing, Infeasible, SpecError
from .exporting.csv import read_csv, write_csv
from .flatness import Reference, reference
from .flight import Flight, load_flight
from .flying import fly
from .kernels.controller import Controller
from .metrics import Score, score
from .planning import Bisection, Grid, Miqp, Plan, RotorMargin, plan, rotor_margin
from .reporting.figures import draw
from .simulation import StateNoise
from .specs import (
    Condition,
    EndState,
    Flip,
    Gate,
    HalfFlip,
    Limits,
    Line,
    Passing,
    Problem,
    Quantity,
    Stage,
    Staged,
    load_problem,
    problem_names,
    rest,
    tilted_gate,
    write_problem,
)
from .states import BodyState, FlatState, Setpoint, Wrench
from .trajectory import Trajectory
from .vehicle import Rotor, Vehicle, load_vehicle, vehicle_names

__all__ = [
    "AerobatError",
    "BackendMissing",
    "Bisection",
    "BodyState",
    "Condition",
    "Controller",
    "EndState",
    "FlatState",
    "Flight",
    "Flip",
    "Gate",
    "Grid",
    "HalfFlip",
    "Infeasible",
    "Limits",
    "Line",
    "Miqp",
    "Passing",
    "Plan",
    "Problem",
    "Quantity",
    "Reference",
    "Rotor",
    "RotorMargin",
    "Score",
    "Setpoint",
    "SpecError",
    "Stage",
    "Staged",
    "StateNoise",
    "Trajectory",
    "Vehicle",
    "Wrench",
    "draw",
    "fly",
    "load_flight",
    "load_problem",
    "load_vehicle",
    "plan",
    "problem_names",
    "read_csv",
    "reference",
    "rest",
    "rotor_margin",
    "score",
    "tilted_gate",
    "vehicle_names",
    "write_csv",
    "write_problem",
]
