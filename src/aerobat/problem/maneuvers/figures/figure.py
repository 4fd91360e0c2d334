"""Figures of aerobatics: where they stand, how large they are, how exactly they are flown."""

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
from aerobat.problem.condition import Attitude, Condition, ConeAngle, Quantity, firm_thrust, within
from aerobat.problem.gate import Gate, named_gate
from aerobat.problem.maneuvers.maneuver import Maneuver
from aerobat.problem.stage import Stage
from aerobat.so3 import UP

LEVEL = 1e-3  # [-] a direction of passage with less across the vertical has no heading


@dataclass(frozen=True, eq=False)
class Place:
    """The place where a figure stands, with coordinates forward, left and up."""

    position: Array  # [m] world, (3,)
    axes: Array  # forward, left and up as rows, unit vectors, world, (3, 3)
    gate: str | None  # the name of the gate that is passed there
    min_thrust: float  # [m/s²] least along the attitude of a stage
    tolerance: float  # [rad] of the attitudes

    def direction(self, *along: float) -> Array:
        """A direction in the world of its coordinates."""
        return np.asarray(along) @ self.axes

    def heads(self, along: Sequence[float], speed: float) -> Condition:
        """Velocity of at least `speed` [m/s] along a direction."""
        return Condition(Quantity.VELOCITY, unit(self.direction(*along)), lower=speed)

    def near(self, point: Sequence[float], margin: float) -> tuple[Condition, ...]:
        """Position [m] within a box about a point, by a margin [m] either way along each axis."""
        return within(self.axes, self.axes @ (self.position + self.direction(*point)), margin)

    def stage(self, name: str, up: Sequence[float], *conditions: Condition, at_gate: bool = False) -> Stage:
        """A stage with the thrust along a direction.

        Args:
            name: of the stage.
            up: where the thrust points, in coordinates of the place.
            conditions: what else holds.
            at_gate: true where the gate, if there is one, is passed then.
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
        """Check."""
        if (self.position is None) == (self.gate is None):
            raise FieldError("position", "or gate says where the figure is entered; give one of them")

    @validated
    def with_stage_thrust(self, gates: Sequence[Gate], thrust: Positive) -> Figure:
        """Return a copy with a least specific thrust [m/s²] in its stages."""
        return replace(self, min_thrust=thrust)

    def in_words(self, gates: Sequence[Gate]) -> str:
        """Return its name, its gate, and that it is mirrored."""
        return super().in_words(gates) + (" mirrored" if self.mirrored else "")

    def place(self, gates: Sequence[Gate], max_specific_thrust: float) -> Place:
        """Return the place where the figure stands.

        Raises SpecError for a gate that is not there, or passed straight up or down.
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
            self.min_thrust or firm_thrust(max_specific_thrust),
            self.tolerance,
        )
