"""An inertia other than planned for, identified from logged body rates and the moments of logged thrusts.

A vehicle of the inertia κ J in place of the planned J is turned by rotors of the moment M with
M = κ (J ω' + ω × J ω). The factor κ of roll and of pitch is found by regression, apart from moments that are
proportional to the thrust (see `balance`). Rotors that give less than the logged thrusts would seem to turn
a larger inertia, and to lift a larger mass. So κ is compared with the factor of the mass, too.
"""

from __future__ import annotations

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.simulation import Flight
from aerobat.simulation.flight import LOG_OF_COMMANDS
from aerobat.studies.inspection.balance import moments_between_rows
from aerobat.studies.inspection.disturbances import between_rows
from aerobat.studies.inspection.result import Fault
from aerobat.vehicle import Vehicle

_MIN_RATIO = 1.4  # smallest factor, up or down, that is a fault: one lab vehicle in 1000 has as much
_MIN_EXPLAINED = 0.5  # [-] least part of the turning (mean square) that the rotors' moments explain
_MIN_EXCITATION = 0.01  # of a rotor's range at the longest arm, RMS moment from which κ can be identified


def inertia_fault(flight: Flight, vehicle: Vehicle, unmodelled: Array) -> Fault | None:
    """Return the deviation of the inertia that a log of measured thrusts shows, None where it shows none.

    Args:
        flight: The log.
        vehicle: The nominal vehicle.
        unmodelled: The acceleration that the vehicle's model does not contain [m/s²], world, (T − 1, 3).
    """
    if flight.engine == LOG_OF_COMMANDS:  # rotors that lag more would seem to turn a larger inertia
        return None
    needed, applied = moments_between_rows(flight, vehicle)
    thrust = between_rows(flight.thrusts).sum(axis=1)
    along = np.sum(unmodelled * between_rows(so3.thrust_axis(flight.q_world_body)), axis=1)
    mass = _factor(thrust, thrust + vehicle.mass * along)
    arm = max(np.hypot(*rotor.position_body[:2]) for rotor in vehicle.rotors)
    least = _MIN_EXCITATION * arm * vehicle.thrust_ranges.max()
    off = []
    for axis, name in enumerate(("roll", "pitch")):
        moment, turning = (_without(each[:, axis], thrust) for each in (applied, needed))
        if np.sqrt(np.mean(moment**2)) < least or not _explains(moment, turning):
            continue
        factor = _factor(moment, turning)
        if _differs(factor, 1.0) and _differs(factor, mass):
            off.append(f"{factor:.1f} times the planned one in {name}")
    return Fault("inertia", f"the inertia is {' and '.join(off)}") if off else None


def _factor(applied: Array, needed: Array) -> float:
    """Return κ of applied = κ needed by regression, which noise of `needed` alone does not bias."""
    return float(applied @ applied / max(applied @ needed, 1e-12 * (applied @ applied)))


def _without(values: Array, thrust: Array) -> Array:
    """Return values without their part that is proportional to the thrust."""
    return np.asarray(values - thrust * (values @ thrust) / (thrust @ thrust))


def _explains(applied: Array, needed: Array) -> bool:
    return bool(applied @ needed > np.sqrt(_MIN_EXPLAINED * (applied @ applied) * (needed @ needed)))


def _differs(factor: float, other: float) -> bool:
    return max(factor / other, other / factor) > _MIN_RATIO
