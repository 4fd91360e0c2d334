"""Stages: sets of conditions that hold together at one instant; a maneuver is a sequence of stages."""

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
from aerobat.problem.condition import Attitude, Condition, Quantity, fixed
from aerobat.problem.gate import Gate, in_opening, named_gate


def _crossing_time(value: Any) -> Any:
    """Return the value, a window as a tuple. Raises FieldError for an invalid time."""
    window = value if isinstance(value, list | tuple) else (value,)
    numbers = all(isinstance(x, int | float) and not isinstance(x, bool) for x in window)
    if value == "free" or (numbers and len(window) == 1 and 0.0 < window[0] < 1.0):
        return value
    if not (numbers and len(window) == 2 and 0.0 <= window[0] < window[1] <= 1.0):
        raise FieldError(
            "", f'must be "free", a fraction between 0 and 1, or two that rise, got {shown(value)}'
        )
    return float(window[0]), float(window[1])


# [-] fraction of the duration at which a stage holds: free, within a window, or fixed
CrossingTime = Annotated[
    Literal["free"] | float | tuple[float, float],
    PlainValidator(_crossing_time),
    Field(description='`"free"`, a fraction of the duration between 0 and 1, or two that rise, a window'),
]
# where a gate's opening is crossed: at its centre, or anywhere
CrossingPoint = Literal["centre", "free"]
MIN_CROSSING_SPEED = 1.0  # [m/s] default least speed through a gate: a vehicle at rest could turn back
PARALLEL = 1e-6  # [-] a direction with a smaller component along a gate's normal is in the gate's plane
# [-] fraction of a gate's attitude tolerance for the plan; the rest is for tracking. With half of it
# half-flips are at most 0.1 % shorter, and twice as many of their flights under `lab` miss the attitude.
PLANNED_SHARE = 0.1
ROUNDING = 1e-9  # [-] of an interval
MAX_INTERVALS = 100  # every window of a hundredth of the duration contains the end of an interval


@declared
class Stage:
    """Conditions that hold together at one instant, which the planner chooses within the freedom of `at`.

    A fraction fixes the stage to the last interval that ends by then, or to `interval_offset` intervals
    later. `gate` names the gate that the stage passes: at its centre, in its direction of passage, at
    `min_speed` or faster. The thrust axis is along the gate's upright if `min_upright_thrust` is given, or as
    `attitude` says, within at most a tenth of the gate's tolerance; the rest is left for tracking errors.
    With a free `crossing_point` the opening is crossed anywhere, at a distance of the vehicle's body and a
    `margin` from its edges. A `ball` is a place, not at a gate, that is met within a radius.
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
        """Check that the fields fit together."""
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
        """The components of the position that the stage's own conditions fix [m], the others NaN, (3,)."""
        place = np.full(3, np.nan)
        for c in self.conditions:
            along = c.direction != 0.0
            if c.quantity is Quantity.POSITION and c.lower == c.upper and along.sum() == 1:
                place[along] = c.lower / c.direction[along]
        return place

    @property
    def where(self) -> tuple[Condition, ...]:
        """The conditions on the stage's position; for a ball, those of the enclosing cube."""
        enclosing = () if self.ball is None else self.ball.circumscribed
        return tuple(c for c in (*self.conditions, *enclosing) if c.quantity is Quantity.POSITION)

    @property
    def is_placed(self) -> bool:
        """True if the stage has conditions on the position along all axes."""
        return len(self.where) >= 3

    def centre(self, gates: Sequence[Gate]) -> Array | None:
        """Return the centre of the stage's gate or ball [m], (3,); None where it has neither."""
        if self.gate is not None:
            return named_gate(gates, self.gate).position
        return None if self.ball is None else self.ball.centre

    def position(self, gates: Sequence[Gate]) -> Array:
        """Return the centre of gate or ball, else the fixed position [m], NaN where it is free, (3,)."""
        centre = self.centre(gates)
        return self.place if centre is None else centre

    @property
    def window(self) -> tuple[float, float]:
        """The earliest and the latest instant at which the stage may hold, as fractions of the duration."""
        if isinstance(self.at, tuple):
            return self.at
        return (0.0, 1.0) if self.at == "free" else (self.at, self.at)

    def slots(self, intervals: int) -> range:
        """Return the intervals, counted from 0, at whose ends the stage may hold; never the last interval.

        The range is empty where a fraction fixes the stage outside them, or a window contains no interval's
        end.
        """
        first, last = self.window
        if first == last:
            fixed = floor(first * intervals + ROUNDING) - 1 + self.interval_offset
            return range(fixed, fixed + 1) if 0 <= fixed < intervals - 1 else range(0)
        earliest = max(ceil(first * intervals - ROUNDING) - 1, 0)
        return range(earliest, min(floor(last * intervals + ROUNDING), intervals - 1))

    @property
    def linear(self) -> Stage:
        """The stage with the conditions of a polytope inside its ball, if it has a ball."""
        return (
            self if self.ball is None else replace(self, conditions=(*self.ball.inscribed, *self.conditions))
        )

    def explicit(self, gate: Gate | None = None, body_radius: float = 0.0) -> Stage:
        """Return the stage with explicit conditions for all that it requires at its gate, except its ball.

        Args:
            gate: The stage's gate.
            body_radius: Of the vehicle's body [m], the clearance from the edges of an opening.
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
            there = fixed(Quantity.POSITION, gate.position)
            if self.crossing_point == "free":
                there = in_opening(gate, body_radius + self.margin)
            there += self._moving_through(gate)
        pointing = () if attitude is None else attitude.conditions
        conditions = (*there, *self.conditions, *pointing)
        return replace(self, conditions=conditions, min_upright_thrust=None, attitude=attitude)

    def _moving_through(self, gate: Gate) -> tuple[Condition, ...]:
        """Return the condition on the speed along the gate's direction, unless the stage's own replace it."""
        along = (abs(c.direction @ gate.normal) for c in self.conditions if c.quantity is Quantity.VELOCITY)
        default = 0.0 if any(part > PARALLEL for part in along) else MIN_CROSSING_SPEED
        speed = default if self.min_speed is None else self.min_speed
        return (Condition(Quantity.VELOCITY, gate.normal, lower=speed),) if speed > 0.0 else ()


def check_crossing(
    gate: str | None, crossing_point: CrossingPoint, margin: float, min_speed: float | None
) -> None:
    """Raise FieldError for fields that need a gate without a gate, and for a margin at a fixed centre."""
    if crossing_point == "free" and gate is None:
        raise FieldError("crossing_point", "needs gate, whose opening is meant; name it")
    check_margin(crossing_point, margin)
    if min_speed is not None and gate is None:
        raise FieldError("min_speed", "needs gate, whose direction of passage is meant; name it")


def check_margin(crossing_point: CrossingPoint, margin: float) -> None:
    """Raise FieldError for a margin where the crossing point is not free."""
    if margin > 0.0 and crossing_point != "free":
        raise FieldError("margin", 'needs crossing_point = "free": a centre has no margin; give both')


@declared
class StageSequence:
    """A maneuver's stages, its path constraints, and whether the stages are ordered.

    A `closed` sequence is periodic: its last stage is followed by its first, with half of the time between
    them before the end and half after the start.
    """

    stages: tuple[Stage, ...] = ()
    path_constraints: tuple[Condition, ...] = ()
    ordered: bool = True
    closed: bool = False

    @property
    def linear(self) -> StageSequence:
        """The sequence with a polytope inside each ball among the conditions, for linear planners."""
        return replace(self, stages=tuple(stage.linear for stage in self.stages))

    @property
    def asks_thrust(self) -> bool:
        """True if a stage has a condition on the direction or the magnitude of the thrust."""
        conditions = (condition for stage in self.stages for condition in stage.conditions)
        return any(condition.quantity is Quantity.SPECIFIC_THRUST for condition in conditions)

    def intervals_from(self, least: int) -> int:
        """Return the fewest intervals, at least `least`, of which one ends in the window of each stage.

        Where more than MAX_INTERVALS would be needed, `least` is returned.
        """
        tried = range(least, max(least, MAX_INTERVALS) + 1)
        return next((n for n in tried if all(stage.slots(n) for stage in self.stages)), least)
