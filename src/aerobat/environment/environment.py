"""Gravity, wind and ground: what a problem is flown in, whichever the vehicle."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import isfinite

import numpy as np

from aerobat.arrays import Array, frozen
from aerobat.errors import SpecError
from aerobat.states import STANDARD_GRAVITY

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Environment:
    """The world around the vehicle, ENU axes.

    Drag acts on the velocity relative to the wind. The ground bounds paths from below, without it nothing
    does. Raises SpecError for a gravity that is not positive and for numbers that are not finite.
    """

    gravity: float = STANDARD_GRAVITY  # [m/s²] along -z
    wind: Array = field(default_factory=lambda: np.zeros(3))  # [m/s] velocity of the air, world, (3,)
    ground: float | None = None  # [m] height z that no path goes below; None: no ground

    def __post_init__(self) -> None:
        object.__setattr__(self, "wind", frozen(self.wind, "environment.wind", (3,)))
        if not (isfinite(self.gravity) and self.gravity > 0.0):
            raise SpecError(
                f"environment.gravity must be a positive acceleration in m/s², got {self.gravity}"
            )
        if self.ground is not None and not isfinite(self.ground):
            raise SpecError(f"environment.ground must be a finite height in m, got {self.ground}")

    @property
    def weight(self) -> Array:
        """The specific thrust [m/s²] that holds a hover, g e3, (3,)."""
        return self.gravity * UP
