"""Aerobat plans, flies and proves aggressive maneuvers for multirotors.

Problem → plan() → Plan.trajectory → fly() → Flight → score() → draw(), write_csv(): every arrow is a frozen
value that can be saved, replayed and tested alone. Solvers, pydantic and matplotlib load when first used.
"""

from aerobat.errors import AerobatError, BackendMissing, Infeasible, SpecError
from aerobat.exporting.csv import read_csv, write_csv
from aerobat.flatness import Reference, reference
from aerobat.flight import Flight, load_flight
from aerobat.flying import fly
from aerobat.kernels.controller import Controller
from aerobat.metrics import Score, score
from aerobat.planning import Bisection, Grid, Miqp, Plan, RotorMargin, plan, rotor_margin
from aerobat.reporting.figures import draw
from aerobat.simulation import StateNoise
from aerobat.specs import (
    Condition,
    EndState,
    Flip,
    Gate,
    HalfFlip,
    Limits,
    Line,
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
from aerobat.states import BodyState, FlatState, Setpoint, Wrench
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Rotor, Vehicle, load_vehicle, vehicle_names

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
