"""A path through waypoints, each with any components given (paper, Section V-B)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import field
from itertools import pairwise
from typing import Annotated

import numpy as np
from pydantic import Field

from aerobat.declaration import (
    FieldError,
    NonNegative,
    PartialVector,
    Positive,
    UnitVector,
    declared,
)
from aerobat.errors import SpecError
from aerobat.problem.ball import Ball
from aerobat.problem.condition import THRUST_FRACTION, Attitude, Condition, Quantity, fixed, free
from aerobat.problem.gate import Gate
from aerobat.problem.maneuvers.maneuver import Maneuver, gate_in_words, in_sequence, maneuver
from aerobat.problem.stage import CrossingPoint, Stage, StageSequence, check_crossing

FIXABLE = (Quantity.POSITION, Quantity.VELOCITY, Quantity.ACCELERATION)


@declared
class Waypoint:
    """Components fixed at one point of the path, world frame; components that are NaN are free.

    With a `radius` the position is met within that distance. `up` sets the direction of the thrust, with
    exactly `thrust` per mass or, without it, at least a fraction of the vehicle's maximum. Raises SpecError
    when nothing is given, or both acceleration and attitude are.
    """

    position: PartialVector = field(default_factory=free)  # [m] world
    velocity: PartialVector = field(default_factory=free)  # [m/s] world
    acceleration: PartialVector = field(default_factory=free)  # [m/s²] world
    up: UnitVector | None = None  # direction of the thrust
    # specific thrust along `up`, the norm of a + g e₃; left out, 20 % or more of what the vehicle has
    thrust: Positive | None = None  # [m/s²]
    time: Positive | None = None  # [s] when to pass by, where a search on times begins
    gate: str | None = None  # name of the gate whose centre is passed
    # through the gate; left out, 1 unless `velocity` says how fast, and 0 leaves it free
    min_speed: NonNegative | None = None  # [m/s]
    crossing_point: CrossingPoint = "centre"  # of the gate's opening: its centre, or free
    margin: NonNegative = 0.0  # [m] from the edges to the body, where the crossing point is free
    radius: Positive | None = None  # [m] about the position, within which it is met

    def __post_init__(self) -> None:
        """Check that the fields fit together."""
        check_crossing(self.gate, self.crossing_point, self.margin, self.min_speed)
        if self.radius is not None and np.isnan(self.position).any():
            raise FieldError("radius", "needs all components of position, the centre; give them")
        if self.radius is not None and self.gate is not None:
            raise FieldError("radius", "stands beside gate, which says where; give one of them")
        if self.thrust is not None and self.up is None:
            raise FieldError("thrust", "needs up, its direction; add it")
        if self.up is not None and not np.isnan(self.acceleration).all():
            raise SpecError("acceleration and up both fix the attitude; give one of them")
        fixes_nothing = all(np.isnan(getattr(self, q.value)).all() for q in FIXABLE)
        if fixes_nothing and self.up is None and self.gate is None:
            raise SpecError("nothing is given; give at least one component of the position")

    def stage(self, name: str, max_specific_thrust: float) -> Stage:
        """Return the stage of passing the waypoint, at a free time, named after its gate if it has one."""
        return Stage(
            name=self.gate or name,
            conditions=tuple(self.conditions()),
            gate=self.gate,
            attitude=self.attitude(max_specific_thrust),
            min_speed=self.min_speed,
            crossing_point=self.crossing_point,
            margin=self.margin,
            ball=self.ball,
        )

    def conditions(self) -> Iterable[Condition]:
        """Yield conditions on the given components and a given thrust; none on the position of a ball."""
        for quantity in FIXABLE if self.radius is None else FIXABLE[1:]:
            yield from fixed(quantity, getattr(self, quantity.value))
        if self.up is not None and self.thrust is not None:
            yield from fixed(Quantity.SPECIFIC_THRUST, self.thrust * self.up)

    @property
    def ball(self) -> Ball | None:
        """The ball about the position, if there is a radius."""
        return None if self.radius is None else Ball(self.position, self.radius)

    @property
    def in_passing(self) -> str:
        """The waypoint, or its gate, in words."""
        return "by a waypoint" if self.gate is None else f"through {gate_in_words(self.gate)}"

    def attitude(self, max_specific_thrust: float) -> Attitude | None:
        """Return the attitude of `up` without a given thrust; None otherwise."""
        if self.up is None or self.thrust is not None:
            return None
        return Attitude(self.up, THRUST_FRACTION * max_specific_thrust)


@maneuver("waypoints")
class Waypoints(Maneuver):
    """From start to goal through waypoints in their order.

    `duration` is an initial guess of the whole path's duration, for planners whose search begins with times
    (paper, Section V-D: its waypoint at 0.5 s, its end at 2 s). Raises SpecError for times that do not rise.
    """

    waypoints: Annotated[tuple[Waypoint, ...], Field(min_length=1)]  # in order
    duration: Positive | None = None  # [s] of the whole path, where a search on times begins

    def __post_init__(self) -> None:
        """Check that the times rise."""
        times = [t for t in (0.0, *(w.time for w in self.waypoints), self.duration) if t is not None]
        if any(later <= earlier for earlier, later in pairwise(times)):
            raise FieldError("waypoints", ": their times must rise, and duration must come last")

    def stage_sequence(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Return a stage for each waypoint, in order, at a time that the planner chooses."""
        numbered = enumerate(self.waypoints, 1)
        return StageSequence(
            tuple(waypoint.stage(f"waypoint {k}", max_specific_thrust) for k, waypoint in numbered)
        )

    def in_words(self, gates: Sequence[Gate]) -> str:
        """Return the waypoints and gates in words, in order."""
        return in_sequence(waypoint.in_passing for waypoint in self.waypoints)

    @property
    def through_points(self) -> bool:
        """True: every stage is a waypoint."""
        return True

    @property
    def first_times(self) -> tuple[float, ...] | None:
        """The times of all waypoints and of the end [s], if all are given."""
        times = [*(w.time for w in self.waypoints), self.duration]
        return None if None in times else tuple(t for t in times if t is not None)
