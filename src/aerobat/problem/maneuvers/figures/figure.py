"""Figures of aerobatics: their place, size and tolerances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import radians
from typing import ClassVar

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import (
    Angle,
    FieldError,
    NonNegative,
    Positive,
    Vector3,
    declared,
    unit,
    validated,
)
from aerobat.problem.condition import Attitude, Condition, ConeAngle, Quantity, min_attitude_thrust, within
from aerobat.problem.gate import Gate, named_gate
from aerobat.problem.maneuvers.maneuver import Maneuver
from aerobat.problem.stage import Stage
from aerobat.so3 import UP

LEVEL = 1e-3  # [-] horizontal component of a direction of passage, below which it has no heading


@dataclass(frozen=True, eq=False)
class Place:
    """The place of a figure, with coordinates forward, left and up."""

    position: Array  # [m] world, (3,)
    axes: Array  # forward, left and up as rows, unit vectors, world, (3, 3)
    gate: str | None  # the name of the gate that is passed there, if any
    min_thrust: float  # [m/s²] least specific thrust along the attitude of a stage
    tolerance: float  # [rad] tolerance of the attitudes

    def direction(self, *along: float) -> Array:
        """Return the world direction of a vector in the place's coordinates."""
        return np.asarray(along) @ self.axes

    def heads(self, along: Sequence[float], speed: float) -> Condition:
        """Return the condition of a velocity of at least `speed` [m/s] along a direction."""
        return Condition(Quantity.VELOCITY, unit(self.direction(*along)), lower=speed)

    def near(self, point: Sequence[float], margin: float) -> tuple[Condition, ...]:
        """Return conditions that keep the position [m] within a margin [m] of a point along each axis."""
        return within(self.axes, self.axes @ (self.position + self.direction(*point)), margin)

    def stage(self, name: str, up: Sequence[float], *conditions: Condition, at_gate: bool = False) -> Stage:
        """Return a stage with the thrust along a direction.

        Args:
            name: of the stage.
            up: direction of the thrust, in coordinates of the place.
            conditions: further conditions.
            at_gate: true where the stage passes the gate, if there is one.
        """
        attitude = Attitude(unit(self.direction(*up)), self.min_thrust, self.tolerance)
        gate = self.gate if at_gate else None
        return Stage(name if gate is None else gate, conditions, attitude=attitude, gate=gate)


@declared
class Figure(Maneuver):
    """A figure that is entered at a place, toward a heading.

    The place is a `position`, or the centre of a `gate`, which is then passed in its direction on entry.
    Raises SpecError where neither or both are given.
    """

    position: Vector3 | None = None  # [m] world, of the entry
    gate: str | None = None  # name of the gate of the entry, instead
    heading: Angle = 0.0  # [rad] of flight on entry, from x toward y; of a gate, its own
    speed: NonNegative = 4.5  # [m/s] at least, on entry and exit
    mirrored: bool = False  # left for right
    tolerance: ConeAngle = radians(15.0)  # [rad] of the thrust's direction in the stages
    # least specific thrust along it; left out, 22.5 of vehicles that have so much beside their weight, of
    # others 20 % of what they have
    min_thrust: Positive | None = None  # [m/s²]

    SHORTHANDS: ClassVar[Mapping[str, str]] = {
        "heading_deg": "[deg] `heading` in degrees",
        "tolerance_deg": "[deg] `tolerance` in degrees (15)",
    }

    def __post_init__(self) -> None:
        """Check that either position or gate is given."""
        if (self.position is None) == (self.gate is None):
            raise FieldError("position", "or gate says where the figure is entered; give one of them")

    @validated
    def with_stage_thrust(self, gates: Sequence[Gate], thrust: Positive) -> Figure:
        """Return a copy with a minimum specific thrust [m/s²] in its stages."""
        return replace(self, min_thrust=thrust)

    def in_words(self, gates: Sequence[Gate]) -> str:
        """Return the figure's name, its gate, and whether it is mirrored."""
        return super().in_words(gates) + (" mirrored" if self.mirrored else "")

    def place(self, gates: Sequence[Gate], max_specific_thrust: float) -> Place:
        """Return the place of the figure.

        Raises SpecError for a gate that does not exist, or is passed straight up or down.
        """
        position, forward = self.position, np.array([np.cos(self.heading), np.sin(self.heading), 0.0])
        if self.gate is not None:
            gate = named_gate(gates, self.gate)
            position, forward = gate.position, gate.normal * [1.0, 1.0, 0.0]
            if np.linalg.norm(forward) < LEVEL:
                raise FieldError(
                    "gate", f"'{gate.name}' is passed straight up or down, without a heading; turn it"
                )
        forward = unit(forward)
        left = np.cross(UP, forward) * (-1.0 if self.mirrored else 1.0)
        return Place(
            np.asarray(position),
            np.array([forward, left, UP]),
            self.gate,
            self.min_thrust or min_attitude_thrust(max_specific_thrust),
            self.tolerance,
        )
