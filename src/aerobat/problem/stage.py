"""Stages: conditions that hold together at one instant; a maneuver is a sequence of them."""

from __future__ import annotations

from dataclasses import replace
from math import ceil, floor
from typing import Annotated, Any, Literal

from pydantic import Field, PlainValidator

from aerobat.declaration import FieldError, Label, NonNegative, Positive, declared, shown
from aerobat.problem.condition import Attitude, Condition, Quantity
from aerobat.problem.gate import Gate, at_centre


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
MIN_CROSSING_SPEED = 1.0  # [m/s] through a gate, where nothing else is asked: who stands still may turn back
PARALLEL = 1e-6  # [-] a direction with less of a gate's normal lies in the gate's plane
PLANNED_SHARE = 0.5  # of a gate's tolerance of attitude: the plan's
ROUNDING = 1e-9  # [-] of an interval


@declared
class Stage:
    """Conditions that hold together at one instant, which the search chooses where `at` leaves it a choice.

    A fraction fixes it to the last interval that ends by then, or `interval_offset` intervals after that
    one. `gate` names the gate that it passes, whose centre it meets in its direction of passage, at
    `min_speed` or faster, with the thrust axis along its upright where `min_upright_thrust` is given, or as
    `attitude` says: within half the gate's tolerance, at most, the rest is left to the flight.
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

    def __post_init__(self) -> None:
        """Check."""
        if self.min_speed is not None and self.gate is None:
            raise FieldError("min_speed", "needs gate, whose direction of passage is meant; name it")
        if self.min_upright_thrust is not None:
            if self.gate is None:
                raise FieldError("min_upright_thrust", "needs gate, whose upright is meant; name it")
            if self.attitude is not None:
                raise FieldError("min_upright_thrust", "stands beside attitude; give one of them")

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

    def explicit(self, gate: Gate | None = None) -> Stage:
        """The same at its gate, with all that it asks among its conditions: also where, and its attitude."""
        attitude = self.attitude
        if gate is not None:
            tolerance = PLANNED_SHARE * gate.attitude_tolerance
            if self.min_upright_thrust is not None:
                attitude = Attitude(gate.up, self.min_upright_thrust, tolerance)
            elif attitude is not None:
                attitude = replace(attitude, tolerance=min(attitude.tolerance, tolerance))
        there = () if gate is None else (*at_centre(gate), *self._moving_through(gate))
        pointing = () if attitude is None else attitude.conditions
        conditions = (*there, *self.conditions, *pointing)
        return replace(self, conditions=conditions, min_upright_thrust=None, attitude=attitude)

    def _moving_through(self, gate: Gate) -> tuple[Condition, ...]:
        """The speed in the gate's direction that is asked beside the stage's own conditions."""
        along = (abs(c.direction @ gate.normal) for c in self.conditions if c.quantity is Quantity.VELOCITY)
        default = 0.0 if any(part > PARALLEL for part in along) else MIN_CROSSING_SPEED
        speed = default if self.min_speed is None else self.min_speed
        return (Condition(Quantity.VELOCITY, gate.normal, lower=speed),) if speed > 0.0 else ()


@declared
class StageSequence:
    """A maneuver made explicit: its stages, what holds throughout, and whether order counts."""

    stages: tuple[Stage, ...] = ()
    path_constraints: tuple[Condition, ...] = ()
    ordered: bool = True
