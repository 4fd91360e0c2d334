"""Passages that a plan intends, through gates and balls: its placed stages, with what the problem's ask.

And, before anything is searched, the openings of gates beside the vehicle that shall pass them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from aerobat.arrays import Array
from aerobat.errors import Reason, SpecError
from aerobat.flatness import force_balance
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
    interval: int  # counted from 0; the stage holds at its end
    time: float  # [s]
    gate: str | None = None  # the name of the gate that is passed there


def place_stages(
    stages: Iterable[Stage], intervals: Iterable[int], times: Iterable[float]
) -> tuple[PlacedStage, ...]:
    """Stages at the ends of intervals and at times [s]."""
    placed = zip(stages, intervals, times, strict=True)
    return tuple(PlacedStage(stage.name, interval, time, stage.gate) for stage, interval, time in placed)


def timed_stages(places: Sequence[PlacedStage], problem: Problem) -> tuple[tuple[Stage, float], ...]:
    """The problem's own stages that are placed, each with its time [s], in the order of the places.

    A place belongs to the first stage of its gate or, without one, of its name, to which none before belongs.
    A gate that no stage names is passed all the same; another place that no stage names is left out.
    """
    waiting = list(problem.stages(1.0).stages)  # the attitudes are the same, whatever thrust there is
    found = []
    for place in places:
        key = (place.gate, None if place.gate else place.name)
        stage = next((each for each in waiting if (each.gate, None if each.gate else each.name) == key), None)
        waiting = [other for other in waiting if other is not stage]
        if stage is not None or place.gate is not None:
            found.append((stage or Stage(place.name, gate=place.gate), place.time))
    return tuple(found)


def as_passed(gates: Sequence[Gate], stages: Sequence[PlacedStage]) -> tuple[Gate, ...]:
    """Gates where they are when placed stages pass them; those that none passes, where they are at first."""
    times = {place.gate: place.time for place in stages}
    return tuple(gate.at(times.get(gate.name, 0.0)) for gate in gates)


def planned_passages(stages: Sequence[PlacedStage], problem: Problem) -> tuple[PlannedPassage, ...]:
    """The gates that are passed at placed stages, as the problem's own stages ask, in their order."""
    asked = timed_stages(stages, problem)
    return tuple(PlannedPassage.of(s, problem.gate(s.gate), t) for s, t in asked if s.gate is not None)


def planned_waypoints(stages: Sequence[PlacedStage], problem: Problem) -> tuple[PlannedWaypoint, ...]:
    """The balls that are met at placed stages, in their order."""
    asked = timed_stages(stages, problem)
    return tuple(PlannedWaypoint(s.name, s.ball, t, s.lap) for s, t in asked if s.ball is not None)


def require_openings(problem: Problem, vehicle: Vehicle) -> None:
    """Refuse a vehicle whose body fits through the opening of a gate in no way that is asked.

    Where the thrust's direction is asked, the body turned about it as it fits best, and flying as it does;
    else in any attitude. Raises SpecError, which names the gate and the least opening.
    """
    for stage in problem.stages(vehicle.max_specific_thrust).stages:
        if stage.gate is not None:
            _require(problem.gate(stage.gate), stage, vehicle)


def require_clear_ends(problem: Problem, vehicle: Vehicle | None) -> None:
    """Refuse ends where the body is in an obstacle, and obstacles where no vehicle says how large it is.

    Raises SpecError, which names the end and by how much it reaches in.
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


def gaps_at_ends(problem: Problem, vehicle: Vehicle) -> tuple[list[float], list[str]]:
    """Return the body's distance from what stands still at each end [m], and the name of the nearest."""
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
    """The least section of a body in the gate, its centre there: of all √S u left and up, S (2, 2) [m²].

    The section of an ellipsoid grows with it: the one about the thrust axis with the lesser of both other
    semi-axes lies within it, however it is turned about that.
    """
    lesser = min(semi_axes[:2]) ** 2
    shape = lesser * np.eye(3) + (semi_axes[2] ** 2 - lesser) * np.outer(thrust_axis, thrust_axis)
    along = shape @ gate.normal
    inside = shape - np.outer(along, along) / (gate.normal @ along)
    return np.asarray(gate.plane_axes @ inside @ gate.plane_axes.T)
