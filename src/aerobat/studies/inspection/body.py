"""Faults of the body, identified from logged body rates and the moments of logged thrusts.

Rotors of the collective thrust T about a centre of mass at (x, y) from the planned one give M_x = −y T and
M_y = x T beyond the planned moment: x and y are found by regression.

A vehicle of the inertia κ J in place of the planned J is turned by rotors of the moment M with
M = κ (J ω' + ω × J ω). The factor κ of roll and of pitch is found by regression, apart from moments that are
proportional to the thrust. Rotors that give less than the logged thrusts would seem to turn a larger inertia,
and to lift a larger mass. So κ is compared with the factor of the mass, too.
"""

from __future__ import annotations

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.simulation import Flight
from aerobat.simulation.flight import LOG_OF_COMMANDS
from aerobat.studies.inspection.disturbances import between_rows
from aerobat.studies.inspection.result import Fault
from aerobat.vehicle import Vehicle

_MIN_OFFSET = 0.05  # of the longest arm, smallest offset that is a fault: four times that of uneven rotors
_MIN_RATIO = 1.4  # smallest factor, up or down, that is a fault: one lab vehicle in 1000 has as much
_MIN_EXPLAINED = 0.5  # [-] least part of the moments (mean square) that a fault explains
_MIN_EXCITATION = 0.01  # of a rotor's range at the longest arm, RMS moment from which κ can be identified


def body_fault(flight: Flight, vehicle: Vehicle, unmodelled: Array) -> Fault | None:
    """Return the offset of the centre of mass, or else the other inertia, that a log shows; None for none.

    Args:
        flight: The log.
        vehicle: The nominal vehicle.
        unmodelled: The acceleration that the vehicle's model does not contain [m/s²], world, (T − 1, 3).
    """
    omega = between_rows(flight.omega_body)
    turned = np.diff(flight.omega_body, axis=0) / np.diff(flight.times)[:, None] @ vehicle.inertia
    needed = turned + so3.cross(omega, omega @ vehicle.inertia)  # [N·m] to turn the planned inertia as logged
    applied = between_rows(flight.thrusts) @ vehicle.allocation[1:].T  # [N·m] by the rotors
    thrust = between_rows(flight.thrusts).sum(axis=1)
    arm = max(np.hypot(*rotor.position_body[:2]) for rotor in vehicle.rotors)
    offset = _balance_fault(needed - applied, thrust, arm)
    if offset is not None or flight.engine == LOG_OF_COMMANDS:
        return offset  # without measured thrusts, slow rotors would seem to turn a larger inertia
    along = np.sum(unmodelled * between_rows(so3.thrust_axis(flight.q_world_body)), axis=1)
    mass = _factor(thrust, thrust + vehicle.mass * along)
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


def _balance_fault(missing: Array, thrust: Array, arm: float) -> Fault | None:
    """Return the offset of the centre of mass by the missing moments, (T − 1, 3), and collective thrusts."""
    roll, pitch, _ = missing.T
    moment = np.stack([pitch, -roll])
    place = moment @ thrust / np.sum(thrust**2)
    rest = np.sum((moment - place[:, None] * thrust) ** 2)
    if np.hypot(*place) < _MIN_OFFSET * arm or rest > (1.0 - _MIN_EXPLAINED) * np.sum(moment**2):
        return None
    ahead, left = (1e3 * each for each in place)
    return Fault("balance", f"the centre of mass is off by {ahead:.1f} mm in x and {left:.1f} mm in y")


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
