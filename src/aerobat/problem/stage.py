"""Stages: linear conditions that hold together at one interval's end; a maneuver is a sequence of them."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from math import inf
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, Strict

from aerobat.arrays import Array
from aerobat.declaration import (
    Direction,
    FieldError,
    Fraction,
    Label,
    Number,
    declared,
    number,
    unit,
)
from aerobat.errors import SpecError


class Quantity(StrEnum):
    """The quantity that a condition is about, all in the world frame."""

    POSITION = "position"  # [m]
    VELOCITY = "velocity"  # [m/s]
    ACCELERATION = "acceleration"  # [m/s²]
    SPECIFIC_THRUST = "specific_thrust"  # a + g e3 [m/s²]

    @property
    def derivative(self) -> int:
        """The derivative of position that the quantity is made of."""
        return {Quantity.POSITION: 0, Quantity.VELOCITY: 1}.get(self, 2)


@declared
class Condition:
    """lower ≤ direction · quantity ≤ upper, in SI units; the direction need not have length one.

    Raises SpecError for a zero direction, and for bounds that are missing or in the wrong order.
    """

    quantity: Annotated[Quantity, Strict(False)]  # specific thrust is a + g e₃
    direction: Direction  # world frame; need not have length one
    lower: Number = -inf  # least value of their product, in the quantity's SI unit
    upper: Number = inf  # greatest value of their product

    SHORTHANDS: ClassVar[Mapping[str, str]] = {"equals": "both bounds at once"}

    def __post_init__(self) -> None:
        """Check."""
        if self.lower == -inf and self.upper == inf:
            raise SpecError("needs lower, upper or equals; give one")
        if self.lower > self.upper:
            raise FieldError("lower", f"must not exceed upper, got {self.lower:g} and {self.upper:g}")

    @classmethod
    def expand(cls, table: dict[str, Any]) -> dict[str, Any]:
        """Replace `equals` by both bounds."""
        if "equals" in table:
            if "lower" in table or "upper" in table:
                raise FieldError("equals", "stands beside lower or upper; give one or the other")
            table["lower"] = table["upper"] = number(table.pop("equals"), "equals")
        return table

    def abbreviate(self, table: dict[str, Any]) -> dict[str, Any]:
        """Write two equal bounds as `equals`."""
        if self.lower == self.upper:
            del table["lower"], table["upper"]
            table["equals"] = self.lower
        return table

    def kinematic_bounds(self, gravity: float) -> tuple[float, float]:
        """Bounds on the derivative of position itself: specific thrust less gravity is the acceleration."""
        weight = self.weight(gravity)
        return self.lower - weight, self.upper - weight

    def weight(self, gravity: float) -> float:
        """Difference [m/s²] that gravity makes between the quantity and the derivative of position."""
        return gravity * float(self.direction[2]) if self.quantity is Quantity.SPECIFIC_THRUST else 0.0

    @property
    def min_thrust(self) -> float:
        """The least specific thrust [m/s²] that satisfies the condition; zero when it asks none."""
        if self.quantity is not Quantity.SPECIFIC_THRUST:
            return 0.0
        return max(self.lower, -self.upper, 0.0) / float(np.linalg.norm(self.direction))


@declared
class Stage:
    """Conditions that hold together at the end of one interval.

    `at` fixes it to the last interval that ends by this fraction of the duration, or `interval_offset`
    intervals after that one; without it the search chooses. `gate` names the gate that it passes.
    """

    name: Label  # shown in reports and pictures
    conditions: tuple[Condition, ...] = ()  # what holds together
    at: Fraction | None = None  # [-] fraction of the duration at which it is; left out, the search chooses
    interval_offset: Annotated[int, Field(ge=0, le=10_000)] = 0  # intervals after that
    gate: str | None = None  # name of the gate whose centre is passed

    def fixed_interval(self, intervals: int) -> int | None:
        """The interval, counted from 0, at whose end the stage is fixed when there are so many; or None."""
        return None if self.at is None else int(self.at * intervals + 1e-9) - 1 + self.interval_offset


@declared
class StageSequence:
    """A maneuver made explicit: its stages, what holds at every interval's end, and whether order counts."""

    stages: tuple[Stage, ...] = ()
    path_constraints: tuple[Condition, ...] = ()
    ordered: bool = True


def thrust_along(direction: Array, axis: Array, minimum: float) -> tuple[Condition, ...]:
    """Specific thrust along `direction` in the plane normal to `axis`: none across, a minimum along.

    Args:
        direction: where the thrust points, world frame, (3,).
        axis: normal to the plane that the condition is about, (3,).
        minimum: least thrust along `direction` [m/s²]; -inf leaves its size and sign free.
    """
    across = Condition(Quantity.SPECIFIC_THRUST, unit(np.cross(axis, direction)), 0.0, 0.0)
    if minimum == -inf:
        return (across,)
    return (across, Condition(Quantity.SPECIFIC_THRUST, unit(direction), lower=minimum))
