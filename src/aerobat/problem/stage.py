"""Stages: conditions that hold together at one instant; a maneuver is a sequence of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, floor
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, PlainValidator

from aerobat.arrays import Array
from aerobat.declaration import Count, FieldError, Label, NonNegative, Positive, declared, shown
from aerobat.problem.ball import Ball
from aerobat.problem.condition import Attitude, Condition, Quantity
from aerobat.problem.gate import Gate, at_centre, in_opening, named_gate


def _crossing_time(value: Any) -> Any:
    """The value, a window as a tuple. Raises FieldError for what is no time."""
    window = value if isinstance(value, list | tuple) else (value,)
    numbers = all(isinstance(x, int | float) and not isinstance(x, bool) for x in window)
    if value == "free" or (numbers and len(window) == 1 and 0.0 < window[0] < 1.0):
        return value
    if not (numbers and len(window) == 2 and 0.0 <= window[0] < window[1] <= 1.0):
        raise FieldError(
            "", f'must be "free", a fraction between 0 and 1, or two that rise, got {shown(value)}'
        )
    return float(window[0]), float(window[1])


# [-] when a stage holds, as a part of the duration: anywhere, between two fractions of it, or at one
CrossingTime = Annotated[
    Literal["free"] | float | tuple[float, float],
    PlainValidator(_crossing_time),
    Field(description='`"free"`, a fraction of the duration between 0 and 1, or two that rise, a window'),
]
# where in a gate's opening it is crossed: at its centre, or anywhere
CrossingPoint = Literal["centre", "free"]
MIN_CROSSING_SPEED = 1.0  # [m/s] through a gate, where nothing else is asked: who stands still may turn back
PARALLEL = 1e-6  # [-] a direction with less of a gate's normal lies in the gate's plane
PLANNED_SHARE = 0.5  # of a gate's tolerance of attitude: the plan's
ROUNDING = 1e-9  # [-] of an interval
MOST_INTERVALS = 100  # one of them ends in every window of a hundredth of the duration


@declared
class Stage:
    """Conditions that hold together at one instant, which the search chooses where `at` leaves it a choice.

    A fraction fixes it to the last interval that ends by then, or `interval_offset` intervals after that
    one. `gate` names the gate that it passes, whose centre it meets in its direction of passage, at
    `min_speed` or faster, with the thrust axis along its upright where `min_upright_thrust` is given, or as
    `attitude` says: within half the gate's tolerance, at most, the rest is left to the flight. With a free
    `crossing_point` it meets the opening anywhere, the vehicle's body and a `margin` away from its edges. A
    `ball` is a place beside any gate that it meets within a radius.
    """

    name: Label  # shown in reports and pictures
    conditions: tuple[Condition, ...] = ()  # what holds together
    at: CrossingTime = "free"  # when, as a part of the duration
    interval_offset: Annotated[int, Field(ge=0, le=10_000)] = 0  # intervals after that
    gate: str | None = None  # name of the gate whose centre is passed
    # specific thrust along the gate's upright, at least; left out, no attitude is asked of the gate
    min_upright_thrust: Positive | None = None  # [m/s²]
    attitude: Attitude | None = None  # where the thrust points, instead
    # through the gate; left out, 1 unless `conditions` say how fast, and 0 leaves it free
    min_speed: NonNegative | None = None  # [m/s]
    crossing_point: CrossingPoint = "centre"  # of the gate's opening: its centre, or free
    margin: NonNegative = 0.0  # [m] from the edges to the body, where the crossing point is free
    ball: Ball | None = None  # where it is, within a radius
    lap: Count = 1  # the lap of a course that it belongs to
    hold: NonNegative = 0.0  # [s] at rest at the position that `conditions` fix

    def __post_init__(self) -> None:
        """Check."""
        check_crossing(self.gate, self.crossing_point, self.margin, self.min_speed)
        if self.ball is not None and self.gate is not None:
            raise FieldError("ball", "stands beside gate, which says where; give one of them")
        if self.hold and np.isnan(self.place).any():
            raise FieldError("hold", "needs conditions that fix the position along x, y and z; add them")
        if self.min_upright_thrust is not None:
            if self.gate is None:
                raise FieldError("min_upright_thrust", "needs gate, whose upright is meant; name it")
            if self.attitude is not None:
                raise FieldError("min_upright_thrust", "stands beside attitude; give one of them")

    @property
    def place(self) -> Array:
        """The components of the position that its own conditions fix [m], the others NaN, (3,)."""
        place = np.full(3, np.nan)
        for c in self.conditions:
            along = c.direction != 0.0
            if c.quantity is Quantity.POSITION and c.lower == c.upper and along.sum() == 1:
                place[along] = c.lower / c.direction[along]
        return place

    @property
    def where(self) -> tuple[Condition, ...]:
        """The conditions on its position, of its ball those of the cube about that."""
        enclosing = () if self.ball is None else self.ball.circumscribed
        return tuple(c for c in (*self.conditions, *enclosing) if c.quantity is Quantity.POSITION)

    @property
    def is_placed(self) -> bool:
        """True if it says where it is, along all axes."""
        return len(self.where) >= 3

    def centre(self, gates: Sequence[Gate]) -> Array | None:
        """The centre of the gate that it passes, or of its ball [m], (3,); None where it has neither."""
        if self.gate is not None:
            return named_gate(gates, self.gate).position
        return None if self.ball is None else self.ball.centre

    def position(self, gates: Sequence[Gate]) -> Array:
        """The centre of its gate or ball, else what its conditions fix [m], NaN where nothing does, (3,)."""
        centre = self.centre(gates)
        return self.place if centre is None else centre

    @property
    def window(self) -> tuple[float, float]:
        """The earliest and the latest instant at which it may hold, as fractions of the duration."""
        if isinstance(self.at, tuple):
            return self.at
        return (0.0, 1.0) if self.at == "free" else (self.at, self.at)

    def slots(self, intervals: int) -> range:
        """The intervals, counted from 0, at whose ends it may hold when there are so many; never the last.

        Empty where a fraction fixes it outside them, or a window holds no interval's end.
        """
        first, last = self.window
        if first == last:
            fixed = floor(first * intervals + ROUNDING) - 1 + self.interval_offset
            return range(fixed, fixed + 1) if 0 <= fixed < intervals - 1 else range(0)
        earliest = max(ceil(first * intervals - ROUNDING) - 1, 0)
        return range(earliest, min(floor(last * intervals + ROUNDING), intervals - 1))

    @property
    def linear(self) -> Stage:
        """The stage with a polytope in its ball, if it has one, among its conditions."""
        return (
            self if self.ball is None else replace(self, conditions=(*self.ball.inscribed, *self.conditions))
        )

    def explicit(self, gate: Gate | None = None, body_radius: float = 0.0) -> Stage:
        """Return the stage at its gate: among its conditions is all that it asks, but its ball.

        Args:
            gate: Its gate.
            body_radius: Of the vehicle's body [m], kept from the edges of an opening.
        """
        attitude = self.attitude
        if gate is not None:
            tolerance = PLANNED_SHARE * gate.attitude_tolerance
            if self.min_upright_thrust is not None:
                attitude = Attitude(gate.up, self.min_upright_thrust, tolerance)
            elif attitude is not None:
                attitude = replace(attitude, tolerance=min(attitude.tolerance, tolerance))
        there: tuple[Condition, ...] = ()
        if gate is not None:
            is_free = self.crossing_point == "free"
            there = in_opening(gate, body_radius + self.margin) if is_free else at_centre(gate)
            there += self._moving_through(gate)
        pointing = () if attitude is None else attitude.conditions
        conditions = (*there, *self.conditions, *pointing)
        return replace(self, conditions=conditions, min_upright_thrust=None, attitude=attitude)

    def _moving_through(self, gate: Gate) -> tuple[Condition, ...]:
        """The speed in the gate's direction that is asked beside the stage's own conditions."""
        along = (abs(c.direction @ gate.normal) for c in self.conditions if c.quantity is Quantity.VELOCITY)
        default = 0.0 if any(part > PARALLEL for part in along) else MIN_CROSSING_SPEED
        speed = default if self.min_speed is None else self.min_speed
        return (Condition(Quantity.VELOCITY, gate.normal, lower=speed),) if speed > 0.0 else ()


def check_crossing(
    gate: str | None, crossing_point: CrossingPoint, margin: float, min_speed: float | None
) -> None:
    """Refuse what needs a gate where there is none, and a margin of a centre. Raises FieldError."""
    if crossing_point == "free" and gate is None:
        raise FieldError("crossing_point", "needs gate, whose opening is meant; name it")
    check_margin(crossing_point, margin)
    if min_speed is not None and gate is None:
        raise FieldError("min_speed", "needs gate, whose direction of passage is meant; name it")


def check_margin(crossing_point: CrossingPoint, margin: float) -> None:
    """Refuse a margin where the crossing point is not free. Raises FieldError."""
    if margin > 0.0 and crossing_point != "free":
        raise FieldError("margin", 'needs crossing_point = "free": a centre has no margin; give both')


@declared
class StageSequence:
    """A maneuver made explicit: its stages, what holds throughout, and whether order counts.

    One that is `closed` ends as it begins, in flight, half-way in time from its last stage to its first.
    """

    stages: tuple[Stage, ...] = ()
    path_constraints: tuple[Condition, ...] = ()
    ordered: bool = True
    closed: bool = False

    @property
    def linear(self) -> StageSequence:
        """The sequence with a polytope in each ball among the conditions, for planners that hold these."""
        return replace(self, stages=tuple(stage.linear for stage in self.stages))

    @property
    def asks_thrust(self) -> bool:
        """True if a stage asks where the thrust points, or how much there is."""
        conditions = (condition for stage in self.stages for condition in stage.conditions)
        return any(condition.quantity is Quantity.SPECIFIC_THRUST for condition in conditions)

    def intervals_from(self, least: int) -> int:
        """Return the fewest intervals, from `least` on, of which one ends in the window of each stage.

        Where so many would be more than MOST_INTERVALS, it is `least`.
        """
        tried = range(least, max(least, MOST_INTERVALS) + 1)
        return next((n for n in tried if all(stage.slots(n) for stage in self.stages)), least)
