"""Aerobat plans, flies and proves aggressive maneuvers for multirotors.

Problem → plan() → Plan.trajectory → fly() → Flight → score() → draw(), write_csv(): every arrow is a frozen
value that can be saved, replayed and tested alone. Names are imported when first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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

_HOMES = {
    "errors": ("AerobatError", "BackendMissing", "Infeasible", "SpecError"),
    "exporting.csv": ("read_csv", "write_csv"),
    "flatness": ("Reference", "reference"),
    "flight": ("Flight", "load_flight"),
    "flying": ("fly",),
    "kernels.controller": ("Controller",),
    "metrics": ("Score", "score"),
    "planning": ("Bisection", "Grid", "Miqp", "Plan", "RotorMargin", "plan", "rotor_margin"),
    "reporting.figures": ("draw",),
    "simulation": ("StateNoise",),
    "specs": (
        "Condition",
        "EndState",
        "Flip",
        "Gate",
        "HalfFlip",
        "Limits",
        "Line",
        "Problem",
        "Quantity",
        "Stage",
        "Staged",
        "load_problem",
        "problem_names",
        "rest",
        "tilted_gate",
        "write_problem",
    ),
    "states": ("BodyState", "FlatState", "Setpoint", "Wrench"),
    "trajectory": ("Trajectory",),
    "vehicle": ("Rotor", "Vehicle", "load_vehicle", "vehicle_names"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = sorted(_HOME_OF)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    """Import a public name from its home when it is first asked for."""
    if name not in _HOME_OF:
        raise AttributeError(f"module 'aerobat' has no attribute {name!r}")
    value = getattr(import_module(f"aerobat.{_HOME_OF[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The public names."""
    return __all__
