"""Differential flatness: attitude, rates, moments and rotor thrusts that a trajectory requires."""

from aerobat.flatness.flyable import Flyable, Planned, environment_of, vehicle_of
from aerobat.flatness.inverse_dynamics import axial_drag, force_balance, has_unequal_drag, lateral_drag
from aerobat.flatness.references import Reference, reference, reference_of

__all__ = [
    "Flyable",
    "Planned",
    "Reference",
    "axial_drag",
    "environment_of",
    "force_balance",
    "has_unequal_drag",
    "lateral_drag",
    "reference",
    "reference_of",
    "vehicle_of",
]
