"""Faults of rotors, identified from logged commands and thrusts: too little thrust, or too much lag.

A rotor of lag τ moves within a row of h by (u − f) (1 − e^(−h/τ)) towards its command u. A rotor at its real
maximum stays constant below its command. The factor 1 − e^(−h/τ) of a slow rotor is found by regression. A
delay also makes rotors late: the explanation that fits the thrusts better decides.
"""

from __future__ import annotations

import numpy as np

from aerobat.arrays import Array
from aerobat.simulation import Flight
from aerobat.studies.inspection.disturbances import CommandDelay
from aerobat.studies.inspection.result import Fault
from aerobat.vehicle import Vehicle

_EXCESS_LAG = 0.4  # [-] excess over the nominal lag that is a fault: twice the spread of four rotors in a lab
_MIN_EXCITATION = 0.005  # of a rotor's range, RMS of command less thrust from which a lag can be identified
_MIN_SHORTFALL = 0.1  # of a rotor's range, shortfall of thrust that is a fault
_COMMAND_DURATION = 0.06  # [s] for which the command must have lasted: longer than delays
_STEADY_CHANGE = 0.2  # of the expected rise within a row, below which thrust counts as constant
_MIN_STEADY = 0.02  # fraction of the rows that must show the shortfall
_DIGITS = 3  # decimals of a shown thrust [N]
_RESIDUAL_RATIO = 0.5  # largest residual of a lag over that of a delay for which the lag is the fault


def rotor_fault(flight: Flight, vehicle: Vehicle, delay: CommandDelay) -> Fault | None:
    """Return the fault of rotors that a log shows, None where it shows none.

    The delay of its commands is an alternative explanation of late rotors.
    """
    weak = _weak_rotor(flight, vehicle)
    missing, change = _missing_and_change(flight)
    unexplained = float(np.mean((change - _shares(missing, change) * missing) ** 2))
    if weak is not None or unexplained > _RESIDUAL_RATIO * delay.unexplained:
        return weak
    return lag_fault(flight, vehicle)


def lag_fault(flight: Flight, vehicle: Vehicle) -> Fault | None:
    """Return the fault of the slowest rotor; None where no rotor is slower than its nominal lag allows."""
    missing, change = _missing_and_change(flight)
    period = float(np.median(np.diff(flight.times)))
    lags = -period / np.log(np.clip(1.0 - _shares(missing, change), 1e-9, 1.0 - 1e-9))
    is_excited = np.sqrt(np.mean(missing**2, axis=0)) > _MIN_EXCITATION * vehicle.thrust_ranges
    late = is_excited & (lags > (1.0 + _EXCESS_LAG) * np.maximum(vehicle.lags, period))
    if not late.any():
        return None
    rotor = int(np.argmax(np.where(late, lags, 0.0)))
    lag, planned = (f"{1e3 * float(each[rotor]):.0f} ms" for each in (lags, vehicle.lags))
    return Fault("lag", f"rotor {rotor} takes {lag} to follow, not {planned}")


def _weak_rotor(flight: Flight, vehicle: Vehicle) -> Fault | None:
    """Return a fault if rotors stay constant below commands that have lasted for a while."""
    period = float(np.median(np.diff(flight.times)))
    rows = round(_COMMAND_DURATION / period) + 1
    if rows >= len(flight.times):
        return None
    lasting = np.lib.stride_tricks.sliding_window_view(flight.commands, rows, axis=0).min(axis=-1)[:-1]
    thrusts, change = flight.thrusts[rows - 1 : -1], np.diff(flight.thrusts[rows - 1 :], axis=0)
    missing = lasting - thrusts
    expected = missing * -np.expm1(-period / np.maximum(vehicle.lags, 1e-9))
    steady = (missing > _MIN_SHORTFALL * vehicle.thrust_ranges) & (change < _STEADY_CHANGE * expected)
    if steady.mean() < _MIN_STEADY:
        return None
    rotor = int(np.argmax(steady.sum(axis=0)))
    short, commanded = (
        round(float(np.median(each[:, rotor][steady[:, rotor]])), _DIGITS) for each in (thrusts, lasting)
    )
    return Fault("thrust", f"rotor {rotor} gives {short:.2g} N where {commanded:.2g} N are commanded")


def _missing_and_change(flight: Flight) -> tuple[Array, Array]:
    """Return commands less thrusts, and the changes of thrusts until the next row, (T − 1, n) each."""
    return (flight.commands - flight.thrusts)[:-1], np.diff(flight.thrusts, axis=0)


def _shares(missing: Array, change: Array) -> Array:
    """Return the fraction of `missing` that each rotor makes up within a row, (n,)."""
    return np.asarray(np.sum(missing * change, axis=0) / np.maximum(np.sum(missing**2, axis=0), 1e-12))
