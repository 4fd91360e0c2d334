"""An offset of the centre of mass, identified from the moment that the logged rotor thrusts do not explain.

Rotors of the collective thrust T about a centre of mass at (x, y) from the planned one give M_x = −y T and
M_y = x T beyond the planned moment: x and y are found by regression.
"""

from __future__ import annotations

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.simulation import Flight
from aerobat.studies.inspection.disturbances import between_rows
from aerobat.studies.inspection.result import Fault
from aerobat.vehicle import Vehicle

_MIN_OFFSET = 0.05  # of the longest arm, smallest offset that is a fault: four times that of uneven rotors
_MIN_EXPLAINED = (
    0.5  # [-] least part of the unexplained roll and pitch moment (mean square) due to the offset
)


def balance_fault(flight: Flight, vehicle: Vehicle) -> Fault | None:
    """Return the offset of the centre of mass that a log shows, None where it shows none."""
    needed, applied = moments_between_rows(flight, vehicle)
    roll, pitch, _ = (needed - applied).T
    missing, collective = np.stack([pitch, -roll]), between_rows(flight.thrusts).sum(axis=1)
    place = missing @ collective / np.sum(collective**2)
    rest = np.sum((missing - place[:, None] * collective) ** 2)
    arm = max(np.hypot(*rotor.position_body[:2]) for rotor in vehicle.rotors)
    if np.hypot(*place) < _MIN_OFFSET * arm or rest > (1.0 - _MIN_EXPLAINED) * np.sum(missing**2):
        return None
    ahead, left = (1e3 * each for each in place)
    return Fault("balance", f"the centre of mass is off by {ahead:.1f} mm in x and {left:.1f} mm in y")


def moments_between_rows(flight: Flight, vehicle: Vehicle) -> tuple[Array, Array]:
    """Return the moments [N·m] that turn the planned inertia as logged, and the rotors', (T − 1, 3)."""
    omega = between_rows(flight.omega_body)
    turned = np.diff(flight.omega_body, axis=0) / np.diff(flight.times)[:, None] @ vehicle.inertia
    needed = turned + so3.cross(omega, omega @ vehicle.inertia)
    return needed, between_rows(flight.thrusts) @ vehicle.allocation[1:].T
