"""Conditions on the state at one instant: linear conditions, and attitudes as directions of thrust."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from math import inf, sqrt, tan
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, Strict

from aerobat.arrays import Array
from aerobat.declaration import (
    Direction,
    FieldError,
    Number,
    Positive,
    UnitVector,
    declared,
    number,
    unit,
)
from aerobat.errors import SpecError
from aerobat.so3 import UP
from aerobat.states import STANDARD_GRAVITY

ConeAngle = Annotated[float, Field(ge=0, lt=1.5, description="number from 0 to 1.5 (86°)")]  # [rad]


class Quantity(StrEnum):
    """The quantity that a condition bounds, in the world frame."""

    POSITION = "position"  # [m]
    VELOCITY = "velocity"  # [m/s]
    ACCELERATION = "acceleration"  # [m/s²]
    SPECIFIC_THRUST = "specific_thrust"  # thrust over mass, a + g e3 + (d/m) (v − wind) [m/s²]

    @property
    def derivative(self) -> int:
        """The highest derivative of position on which the quantity depends."""
        return {Quantity.POSITION: 0, Quantity.VELOCITY: 1}.get(self, 2)


@dataclass(frozen=True, eq=False)
class ForceBalance:
    """The force balance over mass: f = a + g e₃ + d (v − wind), with the drag d across the thrust axis."""

    gravity: float = STANDARD_GRAVITY  # [m/s²]
    drag: float = 0.0  # [1/s] across the thrust axis, over the mass
    wind: Array = field(default_factory=lambda: np.zeros(3))  # [m/s] world, (3,)

    @property
    def constant(self) -> Array:
        """The part of f [m/s²] that does not depend on the motion, (3,)."""
        return np.asarray(self.gravity * UP - self.drag * self.wind)

    def specific_thrust(self, velocity: Array, acceleration: Array) -> Array:
        """Return f [m/s²], world, (..., 3), from the velocity relative to the ground and the acceleration."""
        return np.asarray(acceleration + self.drag * velocity + self.constant)


@dataclass(frozen=True, eq=False)
class LinearBound:
    """lower ≤ weights[0] · p + weights[1] · v + weights[2] · a + constant ≤ upper, SI units, world frame."""

    weights: Array  # (3, 3), a row for each derivative of position
    constant: float
    lower: float
    upper: float

    @property
    def limits(self) -> tuple[float, float]:
        """The bounds less the constant: bounds on the weighted derivatives alone."""
        return self.lower - self.constant, self.upper - self.constant

    @property
    def derivatives(self) -> tuple[int, ...]:
        """The derivatives of position with nonzero weights."""
        return tuple(np.flatnonzero(self.weights.any(axis=1)).tolist())

    @property
    def scale(self) -> float:
        """The scale of the bounded value, for comparisons between bounds."""
        if -inf < self.lower < self.upper < inf:
            return self.upper - self.lower
        return max((abs(x) for x in self.limits if abs(x) < inf), default=0.0) or 1.0

    def value(self, derivatives: Array) -> Array:
        """Return the bounded value, (...), from position, velocity and acceleration, (..., 3, 3)."""
        return np.asarray(np.sum(self.weights * derivatives, axis=(-2, -1)) + self.constant)

    def excess(self, derivatives: Array) -> Array:
        """Return the constraint violation, at least zero, (...), from derivatives (..., 3, 3)."""
        value = self.value(derivatives)
        return np.maximum(np.maximum(self.lower - value, value - self.upper), 0.0)


@declared
class Condition:
    """lower ≤ direction · quantity ≤ upper, in SI units; the direction need not have length one.

    Raises SpecError for a zero direction, and for bounds that are missing or in the wrong order.
    """

    # specific thrust is a + g e₃ and, where a vehicle is known, its drag per mass
    quantity: Annotated[Quantity, Strict(False)]
    direction: Direction  # world frame; need not have length one
    lower: Number = -inf  # least value of their product, in the quantity's SI unit
    upper: Number = inf  # greatest value of their product

    SHORTHANDS: ClassVar[Mapping[str, str]] = {"equals": "both bounds at once"}

    def __post_init__(self) -> None:
        """Check the bounds."""
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

    def bound(self, balance: ForceBalance) -> LinearBound:
        """Return the bound on position, velocity and acceleration that the condition implies."""
        weights = np.zeros((3, 3))
        weights[self.quantity.derivative] = self.direction
        constant = 0.0
        if self.quantity is Quantity.SPECIFIC_THRUST:
            weights[1] = balance.drag * self.direction
            constant = float(self.direction @ balance.constant)
        return LinearBound(weights, constant, self.lower, self.upper)

    @property
    def name(self) -> str:
        """The bounded quantity, in words."""
        direction = ", ".join(f"{x:.4g}" for x in self.direction)
        return f"{self.quantity.replace('_', ' ')} along ({direction})"

    @property
    def range(self) -> str:
        """The allowed values, in words."""
        if self.lower == self.upper:
            return f"of {self.lower:.4g}"
        if self.upper == inf:
            return f"of {self.lower:.4g} or more"
        if self.lower == -inf:
            return f"of {self.upper:.4g} or less"
        return f"between {self.lower:.4g} and {self.upper:.4g}"

    @property
    def min_thrust(self) -> float:
        """The least specific thrust [m/s²] that satisfies the condition; zero when it requires none."""
        if self.quantity is not Quantity.SPECIFIC_THRUST:
            return 0.0
        return max(self.lower, -self.upper, 0.0) / float(np.linalg.norm(self.direction))


THRUST_FRACTION = 0.2  # of the maximum specific thrust: the default minimum along an attitude
# [m/s²] specific thrust that keeps attitudes at speed. Disturbances and feedback against them reach 4 m/s²
# across in 95 % of flights under `lab`, and tilt this thrust by 10°, the usual tolerance.
MIN_ATTITUDE_THRUST = 22.5


def min_attitude_thrust(max_specific_thrust: float) -> float:
    """Return the least specific thrust [m/s²] along an attitude that is kept at speed.

    This is MIN_ATTITUDE_THRUST for a vehicle with that much thrust beyond its weight, else a fraction of its
    maximum.
    """
    is_strong = max_specific_thrust - STANDARD_GRAVITY >= MIN_ATTITUDE_THRUST
    return MIN_ATTITUDE_THRUST if is_strong else THRUST_FRACTION * max_specific_thrust


@declared
class Attitude:
    """Thrust along a direction: the thrust axis within a cone about `up`, and a minimum specific thrust.

    The linear conditions describe the square pyramid inside the cone; without tolerance, exactly `up`.
    """

    up: UnitVector  # where the thrust points, world
    min_thrust: Positive  # [m/s²] specific thrust along `up`, at least
    tolerance: ConeAngle = 0.0  # [rad] between the thrust axis and `up`, at most

    SHORTHANDS: ClassVar[Mapping[str, str]] = {"tolerance_deg": "[deg] `tolerance` in degrees"}

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """The linear conditions of the attitude."""
        along = Condition(Quantity.SPECIFIC_THRUST, self.up, lower=self.min_thrust)
        if self.tolerance == 0.0:
            none = (Condition(Quantity.SPECIFIC_THRUST, axis, 0.0, 0.0) for axis in across(self.up))
            return (*none, along)
        slope = tan(self.tolerance) / sqrt(2.0)
        faces = (sign * axis - slope * self.up for axis in across(self.up) for sign in (1.0, -1.0))
        return (*(Condition(Quantity.SPECIFIC_THRUST, face, upper=0.0) for face in faces), along)


def free() -> Array:
    """Return three free components: NaN."""
    return np.full(3, np.nan)


def fixed(quantity: Quantity, value: Array) -> tuple[Condition, ...]:
    """Return conditions that fix a quantity's components, world, SI units, (3,), except NaN components."""
    given = zip(np.eye(3), value.tolist(), strict=True)
    return tuple(Condition(quantity, axis, x, x) for axis, x in given if x == x)


def within(directions: Array, middles: Array, margin: float) -> tuple[Condition, ...]:
    """Return conditions: position along directions (n, 3) within a margin [m] of middles [m] (n,)."""
    return tuple(
        Condition(Quantity.POSITION, direction, middle - margin, middle + margin)
        for direction, middle in zip(directions, middles.tolist(), strict=True)
    )


def thrust_in_plane(direction: Array, axis: Array, minimum: float) -> tuple[Condition, ...]:
    """Return conditions for thrust in the plane normal to `axis`: zero across `direction`, a minimum along.

    Args:
        direction: of the thrust, world frame, (3,).
        axis: normal of the plane, (3,).
        minimum: least thrust along `direction` [m/s²]; -inf leaves magnitude and sign free.
    """
    across_it = Condition(Quantity.SPECIFIC_THRUST, unit(np.cross(axis, direction)), 0.0, 0.0)
    if minimum == -inf:
        return (across_it,)
    return (across_it, Condition(Quantity.SPECIFIC_THRUST, unit(direction), lower=minimum))


def leaning_at_most(direction: Array, axis: Array, angle: float) -> tuple[Condition, ...]:
    """Return conditions that limit the angle of the thrust from `direction` toward `axis`, on either side.

    Args:
        direction: unit vector, world frame, (3,).
        axis: unit vector normal to it, (3,).
        angle: largest angle, less than a right one [rad].
    """
    normals = (sign * np.cos(angle) * axis - np.sin(angle) * direction for sign in (1.0, -1.0))
    return tuple(Condition(Quantity.SPECIFIC_THRUST, normal, upper=0.0) for normal in normals)


def across(direction: Array) -> tuple[Array, Array]:
    """Return two unit vectors normal to a unit vector and to each other."""
    first = unit(np.cross(direction, np.eye(3)[int(np.argmin(np.abs(direction)))]))
    return first, unit(np.cross(direction, first))
