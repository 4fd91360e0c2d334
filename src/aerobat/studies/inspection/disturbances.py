"""Accelerations of a logged vehicle that its position loop does not explain, split by cause.

The error is e = p − p_ref; the position loop's feedback to an error is F(e) = −(k_p e + k_v e' + k_i ∫e).
Thus

    e'' = F(e) + [F(ê) − F(e)] + [a_thrust − a_ref − F(ê)] + [a − a_thrust].

Here ê is the error that the observer estimates, and a_thrust is the acceleration of the nominal vehicle under
the logged thrusts. The brackets are the effect of estimation errors, the part of the command that thrust and
attitude did not deliver, and the part that the vehicle's model does not contain.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.control.parameters import controller_parameters
from aerobat.kernels.control_loops import Gains
from aerobat.simulation import Flight
from aerobat.vehicle import Vehicle
from aerobat.vehicle.allocation import rotor_thrusts
from aerobat.vehicle.controller import Controller
from aerobat.vehicle.fleet import Fleet

_RECOVERY = 3.0  # time constants 1/ω_n of the attitude loop for which a saturation has an effect
_SLACK = 0.02  # of a rotor's range, error of derivatives taken between rows
_CLOCK = 1e-6  # [s] resolution of clocks
_LONGEST_DELAY = 0.2  # [s] longest delay that is tried


@dataclass(frozen=True)
class PositionLoop:
    """Gains of the position loop, and the recovery time of the attitude loop."""

    position: float  # [1/s²]
    velocity: float  # [1/s]
    integral: float  # [1/s³]
    recovery: float  # [s] for which a saturation has an effect

    @classmethod
    def of(cls, controller: Controller, vehicle: Vehicle, flight: Flight) -> PositionLoop:
        """Return the gains that a controller has for a vehicle."""
        gains: Gains = controller_parameters(controller, Fleet.of([vehicle]), flight.environment).gains
        p, v, i, stiffness = (
            float(np.ravel(gain)[0])
            for gain in (gains.position, gains.velocity, gains.integral, gains.stiffness)
        )
        return cls(p, v, i, _RECOVERY / np.sqrt(max(stiffness, 1e-9) / 2.0))

    def feedback(self, times: Array, error: Array, rate: Array) -> Array:
        """Return the feedback [m/s²] to errors [m] and their rates [m/s], (T, 3)."""
        steps = np.diff(times)[:, None] * between_rows(error)
        integral = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        return -(self.position * error + self.velocity * rate + self.integral * integral)


class ShortfallCause(IntEnum):
    """The reason for an acceleration that was commanded but not delivered between two rows."""

    UNSATURATED = 0
    BY_PLAN = 1  # saturation, since the set-points themselves exceed the rotors' limits
    BY_FEEDBACK = 2  # saturation by feedback to an earlier error, with feasible set-points


@dataclass(frozen=True)
class Disturbances:
    """Mean accelerations [m/s²] between rows, world, (T − 1, 3) each."""

    observer: Array  # due to estimation errors
    vehicle: Array  # due to errors of the vehicle's model
    missing: Array  # commanded but not delivered
    kinds: Array  # ShortfallCause of `missing`, (T − 1,)


def disturbances(flight: Flight, vehicle: Vehicle, loop: PositionLoop) -> Disturbances:
    """Return the accelerations that the position loop of the nominal `vehicle` does not explain, by cause."""
    true = loop.feedback(
        flight.times,
        flight.position - flight.setpoint_position,
        flight.velocity - flight.setpoint_velocity,
    )
    seen = true
    if flight.is_observed:
        seen = loop.feedback(
            flight.times,
            flight.observed_position - flight.setpoint_position,
            flight.observed_velocity - flight.setpoint_velocity,
        )
    lift = _lift(flight, vehicle) - flight.setpoint_acceleration
    off = flight.velocity - flight.setpoint_velocity
    moved = np.diff(off, axis=0) / np.diff(flight.times)[:, None]
    return Disturbances(
        observer=between_rows(seen - true),
        vehicle=moved - between_rows(lift),
        missing=between_rows(lift - seen),
        kinds=_kinds(flight, vehicle, loop.recovery),
    )


@dataclass(frozen=True)
class CommandDelay:
    """The delay from commands to rotor thrusts."""

    time: float  # [s] from 0 to 0.2
    unexplained: float  # [N²] mean square residual of the change of thrust in a row


def command_delay(flight: Flight, vehicle: Vehicle) -> CommandDelay:
    """Return the delay from commands to rotor thrusts, identified with the rotors' nominal lags.

    Rotors have the lag τ, a row lasts h, and the delay d is at most one row. A command change from u to u'
    then leaves the error (u − u') (e^(−(h − d)/τ) − e^(−h/τ)) against no delay. The factor, and so d, is
    found by regression.
    """
    steps = np.diff(flight.times)
    h = float(np.median(steps))
    lags = np.maximum(vehicle.lags, 1e-9)
    left = np.exp(-h / lags)
    thrusts, commands = flight.thrusts, flight.commands
    best, delay = np.inf, 0.0
    for rows in range(min(int(_LONGEST_DELAY / h), len(steps) // 2)):
        now = commands[1 : len(commands) - 1 - rows]
        before = commands[: len(commands) - 2 - rows]
        start = thrusts[1 + rows : -1]
        rest = thrusts[2 + rows :] - now - (start - now) * left
        change = before - now
        power = float(np.sum(change**2))
        slope = float(np.clip(np.sum(rest * change) / power, 0.0, 1.0 - left.mean())) if power > 0.0 else 0.0
        remains = float(np.mean((rest - slope * change) ** 2))
        if remains < best * (1.0 - 1e-6):
            lag = float(lags.mean())
            best, delay = remains, rows * h + h + lag * float(np.log(slope + np.exp(-h / lag)))
    return CommandDelay(delay, float(best))


def _lift(flight: Flight, vehicle: Vehicle) -> Array:
    """Return the acceleration [m/s²] of the nominal vehicle under the logged thrusts, (T, 3)."""
    q, air = flight.q_world_body, flight.environment
    drag = so3.rotate(q, vehicle.drag_body * so3.unrotate(q, flight.velocity - air.wind))
    collective = flight.thrusts.sum(axis=-1)[:, None] * so3.thrust_axis(q)
    return np.asarray((collective - drag) / vehicle.mass - air.weight)


def _kinds(flight: Flight, vehicle: Vehicle, recovery: float) -> Array:
    """Return the ShortfallCause between rows; a saturation counts for `recovery` [s] after it, (T − 1,)."""
    begin = flight.times[:-1]
    beyond = flight.saturated & _infeasible_setpoints(flight, vehicle)
    saturated, by_plan = (
        begin - np.maximum.accumulate(np.where(rows[:-1], begin, -np.inf)) <= recovery + _CLOCK
        for rows in (flight.saturated, beyond)
    )
    return np.where(
        by_plan,
        ShortfallCause.BY_PLAN,
        np.where(saturated, ShortfallCause.BY_FEEDBACK, ShortfallCause.UNSATURATED),
    )


def _infeasible_setpoints(flight: Flight, vehicle: Vehicle) -> Array:
    """Return True where set-points need thrust, with lag compensation or without, beyond limits, (T,)."""
    required = rotor_thrusts(vehicle, flight.setpoint.wrench)
    slack = _SLACK * (flight.max_thrusts - flight.min_thrusts)
    commands = required + vehicle.lags * np.gradient(required, flight.times, axis=0)
    outside = (np.minimum(required, commands) < flight.min_thrusts - slack) | (
        np.maximum(required, commands) > flight.max_thrusts + slack
    )
    return np.asarray(outside.any(axis=-1))


def between_rows(values: Array) -> Array:
    """Return the means of values in successive rows, (T − 1, ...)."""
    return np.asarray(0.5 * (values[1:] + values[:-1]))
