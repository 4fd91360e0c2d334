"""The states at the start and the end of a motion."""

from __future__ import annotations

from dataclasses import field
from typing import Annotated, cast

import numpy as np
from pydantic import Field

from aerobat.arrays import Array
from aerobat.declaration import FieldError, PartialVector, Vector3, VectorLike, declared, validated
from aerobat.problem.condition import free

VELOCITY = 1  # order of the derivative of position


@declared
class EndState:
    """The world-frame state in which a trajectory begins or ends; derivatives above acceleration are zero.

    A goal with `free_attitude` may be reached in any attitude, with any body rate and thrust, as the finish
    of a race; planners that cannot leave the attitude free use the acceleration. A goal with `free_velocity`
    may be passed at any velocity, and so in any attitude too. A closed course leaves both ends out.
    """

    position: PartialVector = field(default_factory=free)  # [m] world, all of it, but of a closed course
    velocity: Vector3 = field(default_factory=lambda: np.zeros(3))  # [m/s] world
    acceleration: Vector3 = field(default_factory=lambda: np.zeros(3))  # [m/s²] world
    free_attitude: bool = False  # of a goal: any attitude will do, whatever the acceleration
    free_velocity: bool = False  # of a goal: any velocity will do, and any attitude

    def __post_init__(self) -> None:
        """Check the position and the velocity."""
        if np.isnan(self.position).any() and not self.is_left_out:
            raise FieldError(
                "position", "must be a number in all components; give those that are missing or NaN"
            )
        if self.free_velocity and self.velocity.any():
            raise FieldError("free_velocity", "stands beside velocity, which gives one; drop either")

    @property
    def is_left_out(self) -> bool:
        """True for an end without a position, as of a closed course."""
        return bool(np.isnan(self.position).all())

    @property
    def leaves_attitude_free(self) -> bool:
        """True where any attitude is allowed."""
        return self.free_attitude or self.free_velocity

    def fixed(self, order: int) -> Array:
        """Return the orders of the derivatives below `order` that the end fixes, from 0 (position)."""
        return np.array([k for k in range(order) if k != VELOCITY or not self.free_velocity])

    @property
    def asked(self) -> Array:
        """The orders of the derivatives of position, up to acceleration, that a motion must match."""
        return self.fixed(2 if self.leaves_attitude_free else 3)

    @validated
    def derivatives(self, order: Annotated[int, Field(ge=1, le=100)]) -> Array:
        """Return position and its derivatives below `order`, (order, 3)."""
        known = [self.position, self.velocity, self.acceleration]
        return np.array([known[k] if k < len(known) else np.zeros(3) for k in range(order)])


@validated
def at_rest(position: VectorLike) -> EndState:
    """Return the state at rest at `position` [m], (3,)."""
    return EndState(cast(Array, position))
