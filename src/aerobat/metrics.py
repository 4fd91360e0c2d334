"""How well a flight went: tracking errors, the passage of the gate, saturation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array
from aerobat.errors import SpecError
from aerobat.flight import COMPLETE, Flight, divergence
from aerobat.kernels.tally import Tally
from aerobat.problem.gate import Gate
from aerobat.problem.problem import Problem
from aerobat.vehicle import Vehicle

PASSAGE_WINDOW = 0.25  # [s] around the planned passage in which the flown one is looked for


@dataclass(frozen=True)
class Passage:
    """How a vehicle passed a gate: at its nearest approach to the opening's centre."""

    time: float  # [s]
    miss: float  # [m] distance from the centre
    inside: bool  # whether the centre of mass went through the opening
    speed: float  # [m/s]
    attitude_error_deg: float  # angle between the thrust axis and the gate's upright
    clearance: float | None  # [m] from the outermost rotor tip to the frame; negative: a collision


@dataclass(frozen=True)
class Score:
    """A flight in numbers; the gate's are None when the problem has no gate."""

    max_position_error_m: float
    rms_position_error_m: float
    max_attitude_error_deg: float
    rms_attitude_error_deg: float
    gate_miss_m: float | None
    gate_speed_m_s: float | None
    gate_attitude_error_deg: float | None
    gate_clearance_m: float | None
    saturated_fraction: float  # of the control periods, any rotor's command clipped
    outcome: str  # a sentence

    def __str__(self) -> str:
        """One line for people."""
        return (
            f"{self.outcome}; position error {100 * self.max_position_error_m:.2f} cm at most, "
            f"attitude error {self.rms_attitude_error_deg:.2f}° RMS, "
            f"saturated {100 * self.saturated_fraction:.1f} % of the time"
        )


def score(flight: Flight, problem: Problem, vehicle: Vehicle | None = None) -> Score:
    """Score one flight of a plan for `problem`; with the vehicle, its clearance in the gate too.

    Errors are against the set-points in the flight: position as a distance [m], attitude as the angle of
    the relative rotation [deg]. Raises SpecError for a batch of flights.
    """
    if flight.states.position.ndim != 2:
        raise SpecError("score takes one flight at a time; of a batch, score flight[k]")
    position = position_error(flight)
    attitude = np.rad2deg(attitude_error(flight))
    passage = gate_passage(flight, problem.gates[0], vehicle) if problem.gates else None
    return Score(
        max_position_error_m=float(position.max()),
        rms_position_error_m=_rms(position),
        max_attitude_error_deg=float(attitude.max()),
        rms_attitude_error_deg=_rms(attitude),
        gate_miss_m=None if passage is None else passage.miss,
        gate_speed_m_s=None if passage is None else passage.speed,
        gate_attitude_error_deg=None if passage is None else passage.attitude_error_deg,
        gate_clearance_m=None if passage is None else passage.clearance,
        saturated_fraction=float(np.mean(flight.saturated)),
        outcome=_outcome(flight.outcomes[0], passage),
    )


def tally_score(tally: Tally, problem: Problem, vehicle: Vehicle) -> Score:
    """The score of a flight that was added up as it was flown, from its last tally in plain numbers."""
    passage = None
    if problem.gates and tally.nearest_square < np.inf:
        time, *near = tally.nearest
        passage = _passage(problem.gates[0], vehicle, time, *map(np.array, near))
    ticks = max(tally.ticks, 1.0)
    ended = COMPLETE if tally.flying else divergence(tally.stop, bool(tally.sound))
    return Score(
        max_position_error_m=float(np.sqrt(tally.max_square)),
        rms_position_error_m=float(np.sqrt(tally.sum_square / ticks)),
        max_attitude_error_deg=float(np.rad2deg(tally.max_angle)),
        rms_attitude_error_deg=float(np.rad2deg(np.sqrt(tally.sum_square_angle / ticks))),
        gate_miss_m=None if passage is None else passage.miss,
        gate_speed_m_s=None if passage is None else passage.speed,
        gate_attitude_error_deg=None if passage is None else passage.attitude_error_deg,
        gate_clearance_m=None if passage is None else passage.clearance,
        saturated_fraction=tally.saturated / ticks,
        outcome=_outcome(ended, passage),
    )


def passage_window(times: Array, position: Array, gate: Gate) -> NDArray[np.bool_]:
    """At which times (T,) [s] a flight along set-points (T, 3) [m] is looked at for its passage of a gate."""
    planned = np.linalg.norm(position - gate.position, axis=-1)
    return np.asarray(np.abs(times - times[int(np.argmin(planned))]) <= PASSAGE_WINDOW)


def position_error(flight: Flight) -> Array:
    """|p − p_ref| [m], (..., T)."""
    return np.asarray(np.linalg.norm(flight.states.position - flight.setpoint.flat.position, axis=-1))


def attitude_error(flight: Flight) -> Array:
    """The angle between flown and asked attitude [rad], (..., T)."""
    return so3.angle_between(flight.states.q_world_body, flight.setpoint.q_world_body)


def gate_passage(flight: Flight, gate: Gate, vehicle: Vehicle | None = None) -> Passage:
    """The flown path's nearest approach to the gate's centre, around the time of the planned one."""
    window = passage_window(flight.times, flight.setpoint.flat.position, gate)
    times = flight.times[window]
    k, fraction = _nearest(flight.states.position[window] - gate.position)
    nxt = min(k + 1, len(times) - 1)

    def at(values: Array) -> Array:
        inside = values[window]
        return np.asarray(inside[k] + fraction * (inside[nxt] - inside[k]))

    offset = at(flight.states.position) - gate.position
    time = float(times[k] + fraction * (times[nxt] - times[k]))
    return _passage(gate, vehicle, time, offset, at(flight.states.velocity), at(flight.states.q_world_body))


def _passage(
    gate: Gate, vehicle: Vehicle | None, time: float, offset: Array, velocity: Array, attitude: Array
) -> Passage:
    """Of a vehicle `offset` [m] from the gate's centre, its attitude not quite of unit length."""
    attitude = so3.normalize(attitude)
    return Passage(
        time=time,
        miss=float(np.linalg.norm(offset)),
        inside=bool(abs(offset @ gate.lateral) < gate.width / 2 and abs(offset @ gate.up) < gate.height / 2),
        speed=float(np.linalg.norm(velocity)),
        attitude_error_deg=float(np.rad2deg(np.arccos(np.clip(so3.thrust_axis(attitude) @ gate.up, -1, 1)))),
        clearance=None if vehicle is None else _clearance(gate, vehicle, offset, attitude),
    )


def _nearest(points: Array) -> tuple[int, float]:
    """Where a polyline (T, 3) comes nearest to the origin: the piece and the fraction along it."""
    if len(points) == 1:
        return 0, 0.0
    steps = np.diff(points, axis=0)
    squares = np.maximum(np.sum(steps**2, axis=1), 1e-300)
    fractions = np.clip(-np.sum(points[:-1] * steps, axis=1) / squares, 0.0, 1.0)
    distances = np.linalg.norm(points[:-1] + fractions[:, None] * steps, axis=1)
    k = int(np.argmin(distances))
    return k, float(fractions[k])


def _clearance(gate: Gate, vehicle: Vehicle, offset: Array, attitude: Array) -> float:
    """From the frame to the nearest edge of a rotor's disc [m], in the plane of the gate."""
    hubs = offset + so3.rotate(attitude, np.array([r.position_body for r in vehicle.rotors]))
    radii = np.array([r.radius for r in vehicle.rotors])
    spin_axis = so3.thrust_axis(attitude)
    clearances = [
        half - np.max(np.abs(hubs @ axis) + radii * np.sqrt(max(0.0, 1.0 - float(axis @ spin_axis) ** 2)))
        for axis, half in ((gate.lateral, gate.width / 2), (gate.up, gate.height / 2))
    ]
    return float(min(clearances))


def _outcome(flown: str, passage: Passage | None) -> str:
    if flown != COMPLETE or passage is None:
        return flown
    if not passage.inside:
        return f"missed the gate, {passage.miss:.2f} m off its centre at {passage.time:.2f} s"
    if passage.clearance is not None and passage.clearance < 0.0:
        return f"hit the gate's frame, {100 * -passage.clearance:.1f} cm too wide at {passage.time:.2f} s"
    return f"through the gate at {passage.speed:.1f} m/s, {1000 * passage.miss:.1f} mm off its centre"


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
