"""Differential flatness: attitude, rates, moments and rotor thrusts that a trajectory requires."""

from aerobat.flatness.flyable import Flyable as Flyable
from aerobat.flatness.flyable import Planned as Planned
from aerobat.flatness.flyable import environment_of as environment_of
from aerobat.flatness.flyable import vehicle_of as vehicle_of
from aerobat.flatness.inverse_dynamics import axial_drag as axial_drag
from aerobat.flatness.inverse_dynamics import force_balance as force_balance
from aerobat.flatness.inverse_dynamics import has_unequal_drag as has_unequal_drag
from aerobat.flatness.inverse_dynamics import lateral_drag as lateral_drag
from aerobat.flatness.references import Reference as Reference
from aerobat.flatness.references import reference as reference
from aerobat.flatness.references import reference_of as reference_of
