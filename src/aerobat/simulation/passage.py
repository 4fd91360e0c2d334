"""Passages through gates: the crossing of each gate's plane, in its direction, next to the planned instant.

A crossing counts once the vehicle's centre gets PASSAGE_DEPTH beyond the plane before it comes back to it;
one that stops in the gate, turns back, or comes from the other side has not passed. A path may cross
obliquely, as the paper's do, whose gates leave the velocity free: it is judged where it crosses, by the
gate's plane all the same. One that moves along the plane passes no gate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from math import degrees, inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array
from aerobat.certification import PlannedPassage
from aerobat.declaration import by_value
from aerobat.kernels.running_metrics import GateProgress, Snapshot
from aerobat.problem.gate import Gate
from aerobat.simulation.flight import Flight
from aerobat.simulation.outcome import Outcome
from aerobat.vehicle.fleet import Fleet

PASSAGE_WINDOW = 0.25  # [s] around the planned instant in which the crossing is looked for
PASSAGE_DEPTH = 0.05  # [m] beyond the plane, where who crosses it has not merely stopped in it
ZEROS = (np.zeros(1),) * 3
NEVER = Snapshot(np.full(1, inf), ZEROS, ZEROS, (np.ones(1), *ZEROS))


@by_value
@dataclass(frozen=True, eq=False)
class Passage:
    """A gate's plane crossed in its direction, next to the planned instant; NaN where it was not.

    Of many flights, the fields but the name are arrays (flights,).
    """

    gate: str
    time: float  # [s] of the crossing
    miss: float  # [m] from the centre there
    inside: bool  # true if the centre of mass went through the opening
    speed: float  # [m/s]
    attitude_error_deg: float  # angle between the thrust axis and where it shall point
    attitude_tolerance_deg: float  # largest that is allowed; infinite where no attitude is asked
    clearance: float  # [m] from the outermost rotor tip to the frame; negative: a collision; NaN: unknown
    planned: float  # [s] when it was to be crossed; NaN where the flight had ended before
    backward_time: float  # [s] of a crossing against the direction about then; infinite where there is none
    max_distance: float  # [m] beyond the plane about then, negative: before it
    min_distance: float  # [m] likewise

    def of_flight(self, k: int) -> Passage:
        """One flight's of many, in plain numbers."""
        numbers = {field.name: getattr(self, field.name)[k].item() for field in fields(self)[1:]}
        return replace(self, **numbers)

    @property
    def failure(self) -> tuple[Outcome, float, dict[str, object]] | None:
        """One flight's failure, when [s], and its numbers; None where nothing is wrong, or known."""
        if np.isnan(self.planned):
            return None
        if np.isnan(self.time):
            return self._instead()
        if not self.inside:
            return Outcome.MISSED_GATE, self.time, {"miss": self.miss}
        if self.clearance < 0.0:
            return Outcome.HIT_FRAME, self.time, {"excess_cm": -100 * self.clearance}
        if self.attitude_error_deg > self.attitude_tolerance_deg:
            angles = {"angle": self.attitude_error_deg, "tolerance": self.attitude_tolerance_deg}
            return Outcome.WRONG_ATTITUDE, self.time, {**angles}
        return None

    def _instead(self) -> tuple[Outcome, float, dict[str, object]]:
        """What happened in place of a crossing in the gate's direction."""
        if self.max_distance <= 0.0:
            return Outcome.SHORT_OF_GATE, self.planned, {"short": -self.max_distance}
        if self.max_distance >= PASSAGE_DEPTH and np.isfinite(self.backward_time):
            return Outcome.BACKWARDS, self.backward_time, {}
        if self.min_distance <= 0.0:
            return Outcome.STOPPED_IN_GATE, self.planned, {"beyond_cm": 100 * self.max_distance}
        return Outcome.EARLY, self.planned, {"early": self.min_distance}


def flown_passages(flight: Flight, planned: Sequence[PlannedPassage], fleet: Fleet | None) -> list[Passage]:
    """Passages of one flight, fields (1,).

    Args:
        flight: what was flown.
        planned: what was to be passed.
        fleet: its vehicle alone, for the clearance.
    """
    diverged = flight.outcome is not Outcome.COMPLETE
    stop = np.array([flight.ends if diverged else np.nan])
    states = flight.states
    parts = (states.position, states.velocity, states.q_world_body)
    return [passages(each, gate_progress(each, flight.times, parts), stop, fleet) for each in planned]


def passages(planned: PlannedPassage, progress: GateProgress, stop: Array, fleet: Fleet | None) -> Passage:
    """Passages of many flights through one gate.

    Args:
        planned: what was to be passed.
        progress: of the vehicles, offsets from the gate's centre as positions; leaves (flights,).
        stop: when flights diverged [s], NaN for those that did not, (flights,).
        fleet: the vehicles, for the clearance.
    """
    gate = planned.gate
    time = progress.crossing.time
    offset, velocity, q = (np.stack(part, axis=-1) for part in progress.crossing[1:])
    q = so3.normalize(q)
    crossed = np.isfinite(time)
    ended_before = ~crossed & (stop <= planned.time)

    def known(values: Array | float, where: NDArray[np.bool_] = crossed) -> Array:
        return np.where(where, values, np.nan)

    across, up = np.abs(offset @ gate.lateral), np.abs(offset @ gate.up)
    tilt = np.arccos(np.clip(so3.thrust_axis(q) @ planned.up, -1, 1))
    clearance = np.full(len(q), np.nan) if fleet is None else _clearance(gate, fleet, offset, q)
    fields: dict[str, Any] = {
        "time": known(time),
        "miss": known(np.linalg.norm(offset, axis=-1)),
        "inside": crossed & (across < gate.width / 2) & (up < gate.height / 2),
        "speed": known(np.linalg.norm(velocity, axis=-1)),
        "attitude_error_deg": known(np.rad2deg(tilt)),
        "attitude_tolerance_deg": np.full(len(q), degrees(planned.attitude_tolerance)),
        "clearance": known(clearance),
        "planned": known(planned.time, ~ended_before),
        "backward_time": progress.backward,
        "max_distance": known(progress.max_distance, ~ended_before),
        "min_distance": known(progress.min_distance, ~ended_before),
    }
    return Passage(gate.name, **fields)


def gate_progress(planned: PlannedPassage, times: Array, states: Sequence[Array]) -> GateProgress:
    """Progress at the end of a flight along a polyline of states; leaves (1,).

    Args:
        planned: what was to be passed.
        times: of the states [s], (T,).
        states: positions, velocities and attitudes, (T, ·).
    """
    offset = states[0] - planned.gate.position
    distance = offset @ planned.gate.normal
    is_beyond = distance > 0.0
    change = np.diff(is_beyond.astype(int))
    parts = (offset, *states[1:])
    found = []
    for k in np.flatnonzero(change > 0):
        ahead = is_beyond[k + 1 :]
        until = len(ahead) if ahead.all() else int(np.argmin(ahead))
        if distance[k + 1 : k + 1 + until].max() >= PASSAGE_DEPTH:
            found.append(_crossing(k, distance, times, parts))
    crossing = _nearest(planned.time, found)
    backward = _nearest(
        planned.time, [_crossing(k, distance, times, parts) for k in np.flatnonzero(change < 0)]
    )
    in_window = np.abs(times - planned.time) <= PASSAGE_WINDOW
    about = distance[in_window] if in_window.any() else distance[-1:]
    return GateProgress(
        NEVER,
        np.zeros(1),
        NEVER if crossing is None else crossing,
        np.full(1, np.inf) if backward is None else backward.time,
        np.array([about.max()]),
        np.array([about.min()]),
    )


def _crossing(k: np.intp, distance: Array, times: Array, parts: Sequence[Array]) -> Snapshot:
    """The state where the plane is crossed between two rows, leaves (1,)."""
    fraction = -distance[k] / (distance[k + 1] - distance[k])
    time, *rest = (part[k] + fraction * (part[k + 1] - part[k]) for part in (times, *parts))
    return Snapshot(np.array([time]), *(tuple(part[:, None]) for part in rest))


def _nearest(planned: float, crossings: Sequence[Snapshot]) -> Snapshot | None:
    """The crossing next to an instant [s], the first of several; None where none is in the window."""
    near = [each for each in crossings if abs(each.time[0] - planned) <= PASSAGE_WINDOW]
    return min(near, key=lambda each: abs(each.time[0] - planned), default=None)


def _clearance(gate: Gate, fleet: Fleet, offset: Array, q: Array) -> Array:
    """From the frame to the nearest edge of a rotor's disc [m], in the plane of the gate, (flights,)."""
    hubs = offset[:, None] + so3.rotate(q[:, None], fleet.rotor_positions)
    spin_axis = so3.thrust_axis(q)
    sides = []
    for axis, half in ((gate.lateral, gate.width / 2), (gate.up, gate.height / 2)):
        edge = np.sqrt(np.maximum(0.0, 1.0 - (spin_axis @ axis) ** 2))
        sides.append(half - np.max(np.abs(hubs @ axis) + fleet.radii * edge[:, None], axis=-1))
    return np.asarray(np.minimum(*sides))
