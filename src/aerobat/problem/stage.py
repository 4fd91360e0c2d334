"""Stages: linear conditions that hold together at one interval's end; a maneuver is a sequence of them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from math import inf, isnan

import numpy as np

from aerobat.arrays import Array, frozen
from aerobat.errors import SpecError


class Quantity(StrEnum):
    """What a condition is about, all in the world frame."""

    POSITION = "position"  # [m]
    VELOCITY = "velocity"  # [m/s]
    ACCELERATION = "acceleration"  # [m/s²]
    SPECIFIC_THRUST = "specific_thrust"  # a + g e3 [m/s²]

    @property
    def derivative(self) -> int:
        """The derivative of position that the quantity is made of."""
        return {Quantity.POSITION: 0, Quantity.VELOCITY: 1}.get(self, 2)


@dataclass(frozen=True)
class Condition:
    """lower ≤ direction · quantity ≤ upper, in SI units; the direction need not have length one.

    Raises SpecError for a zero direction, a NaN, or bounds in the wrong order.
    """

    quantity: Quantity
    direction: Array  # (3,), world
    lower: float = -inf
    upper: float = inf

    def __post_init__(self) -> None:
        """Check."""
        object.__setattr__(self, "quantity", Quantity(self.quantity))
        object.__setattr__(self, "direction", frozen(self.direction, "condition.direction", (3,)))
        if not self.direction.any():
            raise SpecError("condition.direction must not be the zero vector")
        if isnan(self.lower) or isnan(self.upper) or self.lower > self.upper:
            raise SpecError(
                f"condition.lower must not exceed condition.upper, got {self.lower} and {self.upper}"
            )

    def kinematic_bounds(self, gravity: float) -> tuple[float, float]:
        """Bounds on the derivative of position itself: specific thrust less gravity is the acceleration."""
        weight = self.weight(gravity)
        return self.lower - weight, self.upper - weight

    def weight(self, gravity: float) -> float:
        """What gravity [m/s²] adds to the derivative of position along the direction to make the quantity."""
        return gravity * float(self.direction[2]) if self.quantity is Quantity.SPECIFIC_THRUST else 0.0

    @property
    def min_thrust(self) -> float:
        """The least specific thrust [m/s²] that satisfies the condition; zero when it asks none."""
        if self.quantity is not Quantity.SPECIFIC_THRUST:
            return 0.0
        return max(self.lower, -self.upper, 0.0) / float(np.linalg.norm(self.direction))


@dataclass(frozen=True)
class Stage:
    """Conditions that hold together at the end of one interval.

    `at` fixes it to the last interval that ends by this fraction of the duration, or `interval_offset`
    intervals after that one; without it the search chooses. `gate` names the gate that it passes.
    """

    name: str
    conditions: tuple[Condition, ...]
    at: float | None = None
    interval_offset: int = 0
    gate: str | None = None

    def __post_init__(self) -> None:
        """Check."""
        object.__setattr__(self, "conditions", tuple(self.conditions))
        if self.at is not None and not 0.0 < self.at < 1.0:
            raise SpecError(f"stage '{self.name}': at must be between 0 and 1, a fraction of the duration")

    def fixed_interval(self, intervals: int) -> int | None:
        """The interval, counted from 0, at whose end the stage is fixed when there are so many; or None."""
        return None if self.at is None else int(self.at * intervals + 1e-9) - 1 + self.interval_offset


@dataclass(frozen=True)
class StageSequence:
    """A maneuver made explicit: its stages, what holds at every interval's end, and whether order counts."""

    stages: tuple[Stage, ...] = ()
    path_constraints: tuple[Condition, ...] = ()
    ordered: bool = True
