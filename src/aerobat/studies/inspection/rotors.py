"""Faults of rotors, by what a log says they were commanded and gave: less thrust, or later.

A rotor of lag τ moves within a row of h by (u − f) (1 − e^(−h/τ)) towards its command u. One that gives all
that it can stands still below its command; of one that is slower, the share 1 − e^(−h/τ) is told by
regression. A delay makes rotors late too: the fault is the one that explains their thrusts better.
"""

from __future__ import annotations

import numpy as np

from aerobat.arrays import Array
from aerobat.simulation import Flight
from aerobat.studies.inspection.disturbances import CommandDelay
from aerobat.studies.inspection.result import Fault
from aerobat.vehicle import Vehicle

_LAG_OFF = 0.4  # [-] by which rotors are slower than planned for: twice what a lab's spread makes of four
_EXCITED = 0.005  # of a rotor's range, that thrusts lack of their commands (RMS), so that they tell a lag
_SHORT = 0.1  # of a rotor's range, by which thrust stays below its command,
_WHILE = 0.06  # [s] for which it has been commanded so much: longer than delays,
_STILL = 0.2  # of what it should rise by within a row: it rises by less
_FEWEST_STILL = 0.02  # of the rows, that show it
_DIGITS = 3  # of a thrust [N], below which it is none
_BETTER = 0.5  # of what a delay leaves unexplained, that another lag leaves at most


def rotor_fault(flight: Flight, vehicle: Vehicle, delay: CommandDelay) -> Fault | None:
    """Return the fault of rotors that a log shows, None where it shows none.

    Args:
        flight: The log of one flight.
        vehicle: The vehicle that it was flown for.
        delay: Of its commands, which explains late rotors too.
    """
    weak = _weak(flight, vehicle)
    missing, change = _missing_and_change(flight)
    unexplained = float(np.mean((change - _shares(missing, change) * missing) ** 2))
    if weak is not None or unexplained > _BETTER * delay.unexplained:
        return weak
    return lag_fault(flight, vehicle)


def lag_fault(flight: Flight, vehicle: Vehicle) -> Fault | None:
    """The fault of the rotor that follows its commands latest; None where none is late beside its file."""
    missing, change = _missing_and_change(flight)
    period = float(np.median(np.diff(flight.times)))
    lags = -period / np.log(np.clip(1.0 - _shares(missing, change), 1e-9, 1.0 - 1e-9))
    tells = np.sqrt(np.mean(missing**2, axis=0)) > _EXCITED * vehicle.thrust_ranges
    late = tells & (lags > (1.0 + _LAG_OFF) * np.maximum(vehicle.lags, period))
    if not late.any():
        return None
    rotor = int(np.argmax(np.where(late, lags, 0.0)))
    lag, planned = (f"{1e3 * float(each[rotor]):.0f} ms" for each in (lags, vehicle.lags))
    return Fault("lag", f"rotor {rotor} takes {lag} to follow, not {planned}")


def _weak(flight: Flight, vehicle: Vehicle) -> Fault | None:
    """Rotors stand still below what they have been commanded for a while."""
    period = float(np.median(np.diff(flight.times)))
    rows = round(_WHILE / period) + 1
    if rows >= len(flight.times):
        return None
    lasting = np.lib.stride_tricks.sliding_window_view(flight.commands, rows, axis=0).min(axis=-1)[:-1]
    given, change = flight.thrusts[rows - 1 : -1], np.diff(flight.thrusts[rows - 1 :], axis=0)
    missing = lasting - given
    expected = missing * -np.expm1(-period / np.maximum(vehicle.lags, 1e-9))
    still = (missing > _SHORT * vehicle.thrust_ranges) & (change < _STILL * expected)
    if still.mean() < _FEWEST_STILL:
        return None
    rotor = int(np.argmax(still.sum(axis=0)))
    short, asked = (
        round(float(np.median(each[:, rotor][still[:, rotor]])), _DIGITS) for each in (given, lasting)
    )
    return Fault("thrust", f"rotor {rotor} gives {short:.2g} N where {asked:.2g} N are commanded")


def _missing_and_change(flight: Flight) -> tuple[Array, Array]:
    """What thrusts lack of their commands, and what they change by until the next row, (T − 1, n) each."""
    return (flight.commands - flight.thrusts)[:-1], np.diff(flight.thrusts, axis=0)


def _shares(missing: Array, change: Array) -> Array:
    """The part of what is missing that each rotor makes good within a row, (n,)."""
    return np.asarray(np.sum(missing * change, axis=0) / np.maximum(np.sum(missing**2, axis=0), 1e-12))
