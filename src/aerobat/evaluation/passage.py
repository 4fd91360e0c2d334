"""Passages through gates: the crossing of each gate's plane, in its direction, next to the planned instant.

A crossing counts once the vehicle's centre gets PASSAGE_DEPTH beyond the plane before it comes back to it;
one that stops in the gate, turns back, or comes from the other side has not passed. A path may cross
obliquely, as the paper's do, whose gates leave the velocity free: it is judged where it crosses, by the
gate's plane all the same. One that moves along the plane passes no gate.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import degrees, inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array
from aerobat.declaration import by_value
from aerobat.kernels.running_metrics import GateProgress, Snapshot
from aerobat.planning import Plan
from aerobat.problem.gate import Gate
from aerobat.problem.problem import Problem
from aerobat.problem.stage import Stage
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
    attitude_error_deg: float  # angle between the thrust axis and the gate's upright, or what a stage asks
    attitude_tolerance_deg: float  # largest that is allowed; infinite where no attitude is asked
    clearance: float  # [m] from the outermost rotor tip to the frame; negative: a collision; NaN: unknown
    planned: float  # [s] when it was to be crossed; NaN where the flight had ended before
    backward_time: float  # [s] of a crossing against the direction about then; infinite where there is none
    max_distance: float  # [m] beyond the plane about then, negative: before it
    min_distance: float  # [m] likewise


@dataclass(frozen=True, eq=False)
class PlannedPassage:
    """A gate to be passed, when, and with which attitude."""

    gate: Gate
    time: float  # [s]
    up: Array  # where the thrust axis shall point, world, (3,)
    attitude_tolerance: float  # [rad] infinite where no attitude is asked


def planned_passages(goal: Problem | Plan, times: Array, position: Array) -> tuple[PlannedPassage, ...]:
    """The passages of gates in the order of the stages, of all gates where no stage names one.

    When is said by a plan's stages; otherwise by the set-points' nearest approach to the gate's centre, after
    the last one of the same gate.

    Args:
        goal: the problem, or a plan for it.
        times: of the set-points [s], (T,).
        position: of the set-points [m], (T, 3).
    """
    problem = goal.problem if isinstance(goal, Plan) else goal
    stages = [stage for stage in problem.stages(1.0).stages if stage.gate is not None]
    if isinstance(goal, Plan):
        placed = [stage for stage in goal.stages if stage.gate is not None]
        if placed:
            by_name = {stage.name: stage for stage in stages}
            return tuple(
                _planned(problem.gate(str(stage.gate)), stage.time, by_name.get(stage.name))
                for stage in placed
            )
    asked: list[tuple[Gate, Stage | None]] = [(problem.gate(str(stage.gate)), stage) for stage in stages]
    asked = asked or [(gate, None) for gate in problem.gates]
    instants = _nearest_instants([gate for gate, _ in asked], times, position)
    return tuple(_planned(gate, t, stage) for (gate, stage), t in zip(asked, instants, strict=True))


def _planned(gate: Gate, time: float, stage: Stage | None) -> PlannedPassage:
    if stage is None or stage.attitude is None:
        return PlannedPassage(gate, time, gate.up, inf)
    return PlannedPassage(gate, time, stage.attitude.up, gate.attitude_tolerance)


def _nearest_instants(gates: Sequence[Gate], times: Array, position: Array) -> Iterator[float]:
    latest: dict[str, float] = {}
    for gate in gates:
        distance = np.linalg.norm(position - gate.position, axis=-1)
        after = latest.get(gate.name, -np.inf) + PASSAGE_WINDOW
        latest[gate.name] = float(times[int(np.argmin(np.where(times > after, distance, np.inf)))])
        yield latest[gate.name]


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
