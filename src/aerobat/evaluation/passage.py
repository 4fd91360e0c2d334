"""Passages through gates: the nearest approach to the centre of each, around the planned instant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array
from aerobat.kernels.running_metrics import Snapshot
from aerobat.planning import Plan
from aerobat.problem.gate import Gate
from aerobat.problem.problem import Problem
from aerobat.vehicle.fleet import Fleet

PASSAGE_WINDOW = 0.25  # [s] around the planned passage in which the actual one is looked for


@dataclass(frozen=True)
class Passage:
    """A gate passed, at the nearest approach to its centre; NaN where a flight ended before it.

    Of many flights, the fields but the name are arrays (flights,).
    """

    gate: str
    time: float  # [s]
    miss: float  # [m] distance from the centre
    inside: bool  # true if the centre of mass went through the opening
    speed: float  # [m/s]
    attitude_error_deg: float  # angle between the thrust axis and the gate's upright
    clearance: float  # [m] from the outermost rotor tip to the frame; negative: a collision; NaN: unknown


def gates_of(goal: Problem | Plan) -> tuple[Gate, ...]:
    """The gates in the order in which a problem's stages pass them; all of them where no stage names one."""
    problem = goal.problem if isinstance(goal, Plan) else goal
    passed = [stage.gate for stage in problem.stages(1.0).stages if stage.gate is not None]
    return tuple(map(problem.gate, passed)) or problem.gates


def planned_passages(
    goal: Problem | Plan, gates: tuple[Gate, ...], times: Array, position: Array
) -> tuple[float, ...]:
    """The planned instant [s] of each gate's passage.

    That of a plan's stage, or of the set-points' nearest approach, after the last one of the same gate.

    Args:
        goal: the problem, or a plan for it.
        gates: of the goal, see `gates_of`.
        times: of the set-points [s], (T,).
        position: of the set-points [m], (T, 3).
    """
    if isinstance(goal, Plan):
        planned = tuple(stage.time for stage in goal.stages if stage.gate is not None)
        if planned:
            return planned
    latest: dict[str, float] = {}
    found = []
    for gate in gates:
        distance = np.linalg.norm(position - gate.position, axis=-1)
        after = latest.get(gate.name, -np.inf) + PASSAGE_WINDOW
        latest[gate.name] = float(times[int(np.argmin(np.where(times > after, distance, np.inf)))])
        found.append(latest[gate.name])
    return tuple(found)


def passage_window(times: Array, planned: float) -> NDArray[np.bool_]:
    """The times (T,) [s] at which a flight is looked at for a passage planned at an instant [s]."""
    return np.asarray(np.abs(times - planned) <= PASSAGE_WINDOW)


def passages(gate: Gate, nearest: Snapshot, distance_sq: Array, fleet: Fleet | None) -> Passage:
    """Passages of many flights through one gate.

    Args:
        gate: the gate.
        nearest: the vehicles next to it, offsets from its centre as their positions; leaves (flights,).
        distance_sq: the offsets' squares [m²], infinite where a flight ended before the gate, (flights,).
        fleet: the vehicles, for the clearance.
    """
    offset, velocity, q = (np.stack(part, axis=-1) for part in nearest[1:])
    q = so3.normalize(q)
    reached = np.isfinite(distance_sq)

    def known(values: Array) -> Array:
        return np.where(reached, values, np.nan)

    across, up = np.abs(offset @ gate.lateral), np.abs(offset @ gate.up)
    tilt = np.arccos(np.clip(so3.thrust_axis(q) @ gate.up, -1, 1))
    clearance = np.full(len(q), np.nan) if fleet is None else _clearance(gate, fleet, offset, q)
    return Passage(
        gate.name,
        time=known(nearest.time),  # type: ignore[arg-type] # arrays, see Passage
        miss=known(np.linalg.norm(offset, axis=-1)),  # type: ignore[arg-type]
        inside=reached & (across < gate.width / 2) & (up < gate.height / 2),  # type: ignore[arg-type]
        speed=known(np.linalg.norm(velocity, axis=-1)),  # type: ignore[arg-type]
        attitude_error_deg=known(np.rad2deg(tilt)),  # type: ignore[arg-type]
        clearance=known(clearance),  # type: ignore[arg-type]
    )


def nearest_approach(
    window: NDArray[np.bool_], gate: Gate, times: Array, states: Sequence[Array]
) -> tuple[Snapshot, Array]:
    """Snapshot next to a gate on a polyline of states, and the square of its distance; leaves (1,).

    Args:
        window: the times that count, (T,).
        gate: the gate.
        times: of the states [s], (T,).
        states: positions, velocities and attitudes, (T, ·).
    """
    if not window.any():
        nowhere = (np.zeros((1, 3)), np.zeros((1, 3)), so3.IDENTITY[None])
        return _snapshot(np.zeros(1), nowhere), np.full(1, np.inf)
    offset = states[0][window] - gate.position
    steps = np.diff(offset, axis=0, append=offset[-1:])
    squares = np.maximum(np.sum(steps**2, axis=1), 1e-300)
    fractions = np.clip(-np.sum(offset * steps, axis=1) / squares, 0.0, 1.0)
    k = int(np.argmin(np.linalg.norm(offset + fractions[:, None] * steps, axis=1)))
    nxt = min(k + 1, len(offset) - 1)

    def at(values: Array) -> Array:
        return np.asarray(values[k] + fractions[k] * (values[nxt] - values[k]))[None]

    near = (at(offset), at(states[1][window]), at(states[2][window]))
    return _snapshot(at(times[window]), near), np.sum(near[0] ** 2, axis=-1)


def _snapshot(time: Array, parts: Sequence[Array]) -> Snapshot:
    return Snapshot(time, *(tuple(np.moveaxis(part, -1, 0)) for part in parts))


def _clearance(gate: Gate, fleet: Fleet, offset: Array, q: Array) -> Array:
    """From the frame to the nearest edge of a rotor's disc [m], in the plane of the gate, (flights,)."""
    hubs = offset[:, None] + so3.rotate(q[:, None], fleet.rotor_positions)
    spin_axis = so3.thrust_axis(q)
    sides = []
    for axis, half in ((gate.lateral, gate.width / 2), (gate.up, gate.height / 2)):
        edge = np.sqrt(np.maximum(0.0, 1.0 - (spin_axis @ axis) ** 2))
        sides.append(half - np.max(np.abs(hubs @ axis) + fleet.radii * edge[:, None], axis=-1))
    return np.asarray(np.minimum(*sides))
