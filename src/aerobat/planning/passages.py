"""Planned passages through gates and balls: placed stages with the requirements of the problem's stages.

The module also checks, before any search, that the vehicle fits through the gates and is clear at the ends.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from aerobat.arrays import Array
from aerobat.errors import Reason, SpecError
from aerobat.flatness import force_balance
from aerobat.flatness.inverse_dynamics import UNDETERMINED
from aerobat.limits.clearance import Clearance
from aerobat.problem.gate import Gate
from aerobat.problem.planned_passage import PlannedPassage, PlannedWaypoint
from aerobat.problem.problem import Problem
from aerobat.problem.stage import Stage
from aerobat.simulation.outcome import length
from aerobat.vehicle import Vehicle


@dataclass(frozen=True)
class PlacedStage:
    """A stage with the interval and the time at which a plan places it."""

    name: str
    interval: int  # counted from 0; the stage holds at the interval's end
    time: float  # [s]
    gate: str | None = None  # name of the stage's gate, if any


def place_stages(
    stages: Iterable[Stage], intervals: Iterable[int], times: Iterable[float]
) -> tuple[PlacedStage, ...]:
    """Return stages placed at the ends of intervals and at times [s]."""
    placed = zip(stages, intervals, times, strict=True)
    return tuple(PlacedStage(stage.name, interval, time, stage.gate) for stage, interval, time in placed)


def timed_stages(places: Sequence[PlacedStage], problem: Problem) -> tuple[tuple[Stage, float], ...]:
    """Return the problem's stages that are placed, each with its time [s], in the order of `places`.

    A place is matched to the first unmatched stage with the same gate or, without a gate, the same name. A
    place without such a stage becomes a stage of its gate alone, or is left out if it has no gate.
    """
    waiting = list(problem.stages(1.0).stages)  # attitudes do not depend on the thrust, here 1.0
    found = []
    for place in places:
        key = (place.gate, None if place.gate else place.name)
        stage = next((each for each in waiting if (each.gate, None if each.gate else each.name) == key), None)
        waiting = [other for other in waiting if other is not stage]
        if stage is not None or place.gate is not None:
            found.append((stage or Stage(place.name, gate=place.gate), place.time))
    return tuple(found)


def as_passed(gates: Sequence[Gate], stages: Sequence[PlacedStage]) -> tuple[Gate, ...]:
    """Return gates at their positions when placed stages pass them; others at their initial positions."""
    times = {place.gate: place.time for place in stages}
    return tuple(gate.at(times.get(gate.name, 0.0)) for gate in gates)


def planned_passages(stages: Sequence[PlacedStage], problem: Problem) -> tuple[PlannedPassage, ...]:
    """Return the passages of gates at placed stages, in order, with the problem's requirements."""
    asked = timed_stages(stages, problem)
    return tuple(PlannedPassage.of(s, problem.gate(s.gate), t) for s, t in asked if s.gate is not None)


def planned_waypoints(stages: Sequence[PlacedStage], problem: Problem) -> tuple[PlannedWaypoint, ...]:
    """Return the balls that placed stages meet, in order."""
    asked = timed_stages(stages, problem)
    return tuple(PlannedWaypoint(s.name, s.ball, t, s.lap) for s, t in asked if s.ball is not None)


def require_openings(problem: Problem, vehicle: Vehicle) -> None:
    """Raise SpecError if the body does not fit through the opening of a gate as the problem asks.

    With a required thrust direction, any rotation about the thrust is allowed, otherwise any attitude. The
    error names the gate and the least opening.
    """
    for stage in problem.stages(vehicle.max_specific_thrust).stages:
        if stage.gate is not None:
            _require(problem.gate(stage.gate), stage, vehicle)


def require_clear_ends(problem: Problem, vehicle: Vehicle | None) -> None:
    """Raise SpecError for ends at which the body is in an obstacle, and for obstacles without a vehicle.

    The error names the end and how far the body reaches into the obstacle.
    """
    environment = problem.surroundings
    if not environment.obstacles:
        return
    if vehicle is None:
        raise SpecError(
            f"'{problem.name}' has obstacles, which the body of a vehicle keeps clear of; give --vehicle"
        )
    for end, left, name in zip(problem.ends, *gaps_at_ends(problem, vehicle), strict=True):
        if left < 0.0:
            raise SpecError(
                f"{end}.position: the body of {vehicle.name} reaches {length(-left)} into '{name}' there; "
                "move one of them"
            )


def require_attitudes_at_ends(problem: Problem, vehicle: Vehicle) -> None:
    """Raise SpecError for ends in free fall, where the thrust is zero and the attitude undetermined."""
    balance = force_balance(problem.environment, vehicle)
    for end, state in problem.ends.items():
        thrust = balance.specific_thrust(state.velocity, state.acceleration)
        if np.linalg.norm(thrust) < UNDETERMINED * problem.environment.gravity:
            raise SpecError(
                f"{end}.acceleration asks no thrust, as in free fall, which leaves the attitude there open; "
                "give another, such as [0, 0, 0]"
            )


def gaps_at_ends(problem: Problem, vehicle: Vehicle) -> tuple[list[float], list[str]]:
    """Return the body's distance from static obstacles at each end [m], and the nearest obstacle's name."""
    environment, ends = problem.surroundings, problem.ends.values()
    positions = np.array([state.position for state in ends]).reshape(-1, 3)
    balance = force_balance(environment, vehicle)
    thrusts = [balance.specific_thrust(state.velocity, state.acceleration) for state in ends]
    clearance = Clearance(environment.pieces.still, vehicle.bounding_ellipsoid)
    return clearance.least(positions, np.array(thrusts).reshape(-1, 3), np.zeros(len(positions)))


def _require(gate: Gate, stage: Stage, vehicle: Vehicle) -> None:
    semi_axes = vehicle.bounding_ellipsoid.semi_axes
    if stage.attitude is None:
        small, large = np.sort(semi_axes)[:2].tolist()
        fits = gate.opening.admits_turned(small, large)
        need, how = (2 * large, 2 * small), "even edgewise, in whichever attitude is the best"
    else:
        section = _least_section(gate, stage.attitude.up, semi_axes)
        fits = gate.opening.admits(section)
        need, how = tuple(2 * np.sqrt(np.diag(section))), "in the attitude that is asked there"
    if not fits:
        width, height = gate.opening.size
        kind = gate.opening.kind
        sentence = (
            f"gate '{gate.name}' is {kind}{length(width)} wide and {length(height)} high, but the body "
            f"of {vehicle.name} takes {length(need[0])} by {length(need[1])}, {how}; widen the opening, or "
            "take a smaller vehicle"
        )
        raise SpecError(Reason(sentence, (f"gate '{gate.name}'",)))


def _least_section(gate: Gate, thrust_axis: Array, semi_axes: Array) -> Array:
    """Return the least section S (2, 2) [m²] of the body in the gate's plane, by left and up.

    The section is the ellipse of all points √S u, |u| ≤ 1, with the body's centre in the plane. The section
    is that of the ellipsoid of revolution about the thrust axis with the smaller of the two other semi-axes.
    This ellipsoid lies within the body at any rotation about the thrust axis.
    """
    lesser = min(semi_axes[:2]) ** 2
    shape = lesser * np.eye(3) + (semi_axes[2] ** 2 - lesser) * np.outer(thrust_axis, thrust_axis)
    along = shape @ gate.normal
    inside = shape - np.outer(along, along) / (gate.normal @ along)
    return np.asarray(gate.plane_axes @ inside @ gate.plane_axes.T)
