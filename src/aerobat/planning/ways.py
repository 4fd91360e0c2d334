"""The way of the body through a gate, clear of its frame from before the plane until it is behind it.

A stage asks where the centre of mass is at one instant. The body is about the plane for a while, and passes
the opening if it flies on much as it flies there. With v_n along the normal and v_a outward across a
side of the opening, d its reach and more before and behind the plane, s what it reaches outward as it is
turned, and r the room that is left to that side from where it crosses, |path − straight line| ≤ ½ a (d/v_n)²:

    (r − s) v_n ± d v_a ≥ ½ a d²/v_n    on all sides    and    v_n² ≥ 2 a d,

so that it does not turn back. The body is an ellipsoid with its semi-axes on the diagonal of D and the
attitude R, so that s = |D Rᵀ e| along e.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import sqrt
from typing import TypeVar

import numpy as np

from aerobat.arrays import Array
from aerobat.certification import PlannedPassage
from aerobat.optimization.deadline import out_of_time
from aerobat.planning.flyability import FLYABLE_ERROR, OwnFlight
from aerobat.problem.condition import Condition, Quantity
from aerobat.problem.gate import Gate
from aerobat.problem.problem import Problem
from aerobat.problem.stage import Stage
from aerobat.simulation.passages import PASSAGE_DEPTH
from aerobat.vehicle import Ellipsoid, Vehicle

Found = TypeVar("Found")

STRAIGHTENINGS = 4  # of the ways of one plan, at most
SLOWEST = 0.5  # [m/s] through a gate, below which no more room is asked: far less than what is asked there
FRAME_CLEARANCE = 0.01  # [m] from body to frame
BENDING = 0.4  # of the largest specific thrust: the acceleration by which a path may bend there, at first
BENDING_IN_MANEUVER = 0.1  # likewise, where a maneuver bends it as it likes
MORE_BENDING = 1.6  # times that, where the plan's own flight does not pass
A_LITTLE_MORE = 1.2  # the same, where it touches the frame by no more than FRAME_CLEARANCE


@dataclass(frozen=True, eq=False)
class Way:
    """A body's way through the gate that a stage crosses."""

    gate: Gate
    stage: int
    reach: float  # [m] before and behind the plane, over which it counts
    bending: float  # [m/s²] across a straight line, at most

    @property
    def sides(self) -> tuple[Array, Array]:
        """Outward normals of the opening's sides in the world, (K, 3), and how far they are, (K,) [m]."""
        normals, distances = self.gate.opening.sides
        return normals @ self.gate.plane_axes, distances - FRAME_CLEARANCE

    @property
    def min_speed(self) -> float:
        """The least speed through the gate [m/s], at which the path does not turn back."""
        return sqrt(2.0 * self.bending * self.reach)

    def conditions(self, position: Array, velocity: Array, thrust: Array, body: Ellipsoid) -> list[Condition]:
        """What it asks of the velocity [m/s] of a path that crosses the gate much as a known one does.

        Args:
            position: Of the known one as it crosses [m], world, (3,).
            velocity: Likewise [m/s].
            thrust: Along its thrust axis, of any length, likewise.
            body: What must be clear of the frame.
        """
        normal, b3 = self.gate.normal, thrust / np.linalg.norm(thrust)
        bent = 0.5 * self.bending * self.reach**2 / max(float(normal @ velocity), SLOWEST)
        offset = position - self.gate.position + body.centre[2] * b3
        wide, high = body.semi_axes[:2].max(), body.semi_axes[2]
        asked = [Condition(Quantity.VELOCITY, normal, lower=self.min_speed)]
        for outward, distance in zip(*self.sides, strict=True):
            upright = (outward @ b3) ** 2
            reached = sqrt(wide**2 * (1.0 - upright) + high**2 * upright) + np.hypot(*body.centre[:2])
            room = (distance - reached - outward @ offset) * normal
            asked += [
                Condition(Quantity.VELOCITY, room + ahead * outward, lower=bent)
                for ahead in (-self.reach, self.reach)
            ]
        return asked


def ways_through_gates(stages: Sequence[Stage], problem: Problem, vehicle: Vehicle) -> tuple[Way, ...]:
    """The ways through the gates that stages cross.

    Those among stages that do not say where they are have none, until a flight does not pass them: a flip in
    a gate begins and ends where it likes.
    """
    found = []
    for k in range(len(stages)):
        around = stages[max(k - 1, 0) : k + 2]
        if all(len(each.where) == 3 for each in around):
            found.append(_way(k, stages, problem, vehicle, BENDING))
    return tuple(filter(None, found))


def straighter(
    ways: Sequence[Way], stages: Sequence[Stage], problem: Problem, vehicle: Vehicle, flight: OwnFlight
) -> tuple[Way, ...]:
    """The ways, straighter through the gates that a flight along them did not pass, and new ones there.

    Args:
        ways: Through gates that the stages cross.
        stages: In order.
        problem: Its gates are crossed.
        vehicle: What flies.
        flight: With a passage for each stage that names a gate.
    """
    crossing = [k for k, stage in enumerate(stages) if stage.gate is not None]
    missed = {k: flown for k, flown in zip(crossing, flight.passages, strict=True) if flown.is_missed}
    found: dict[int, Way | None] = {way.stage: way for way in ways}
    for k, flown in missed.items():
        last = found.get(k)
        if last is None:
            found[k] = _way(k, stages, problem, vehicle, BENDING_IN_MANEUVER)
        else:
            touches = flown.clearance is not None and flown.clearance >= -FRAME_CLEARANCE
            found[k] = replace(last, bending=(A_LITTLE_MORE if touches else MORE_BENDING) * last.bending)
    return tuple(way for way in found.values() if way is not None)


def straightened(
    found: Found,
    flown: Callable[[Found], OwnFlight],
    again: Callable[[Found, OwnFlight], Found | None],
) -> tuple[OwnFlight, Found]:
    """The best of what was found and of straighter ways through gates that its own flight does not pass.

    With its flight. Only where that keeps to its path: else it is not the path that misses them.

    Args:
        found: What flies.
        flown: Its own flight.
        again: What is found on straighter ways than those of a flight; None where there is nothing.
    """
    best = flight, _ = flown(found), found
    for _ in range(STRAIGHTENINGS):
        if not (flight.lingers and flight.error <= FLYABLE_ERROR) or out_of_time():
            break
        following = again(found, flight)
        if following is None:
            break
        flight, found = flown(following), following
        best = min(best, (flight, found), key=lambda pair: pair[0].rank)
    return best


def _way(k: int, stages: Sequence[Stage], problem: Problem, vehicle: Vehicle, bending: float) -> Way | None:
    """The way through the gate that stage k crosses, in its direction; None where it crosses none."""
    name = stages[k].gate
    if name is None or PlannedPassage.of(stages[k], problem.gate(name), 0.0).min_speed <= 0.0:
        return None
    reach = vehicle.body_radius + PASSAGE_DEPTH
    return Way(problem.gate(name), k, reach, bending * vehicle.max_specific_thrust)
