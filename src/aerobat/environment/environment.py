"""Gravity, wind and ground: what a problem is flown in, whichever the vehicle."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import Finite, Gravity, Vector3, declared
from aerobat.so3 import UP
from aerobat.states import STANDARD_GRAVITY


@declared
class Environment:
    """The world around the vehicle, ENU axes.

    Drag acts on the velocity relative to the wind. The ground bounds paths from below, without it nothing
    does.
    """

    gravity: Gravity = STANDARD_GRAVITY  # [m/s²] along -z
    wind: Vector3 = field(default_factory=lambda: np.zeros(3))  # [m/s] velocity of the air
    ground: Finite | None = None  # [m] height z that no path goes below; left out, no ground

    @property
    def weight(self) -> Array:
        """The specific thrust [m/s²] that holds a hover, g e3, (3,)."""
        return self.gravity * UP
