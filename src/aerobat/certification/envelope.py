"""Limits that a flight shall stay within, beside those of the rotors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerobat.arrays import frozen_bounds
from aerobat.errors import SpecError
from aerobat.problem import Limits

NO_LIMITS = Limits()


@dataclass(frozen=True)
class Envelope:
    """Limits over continuous time; infinite where there is none.

    `limits` bounds position and its derivatives per axis, as a problem does. Raises SpecError for limits
    that are not positive numbers.
    """

    speed: float = np.inf  # [m/s] |v|
    tilt: float = np.inf  # [rad] between the thrust axis and the vertical; beyond pi it limits nothing
    body_rate: float = np.inf  # [rad/s] |ω|
    moment: float = np.inf  # [N·m] |M|
    limits: Limits = NO_LIMITS

    def __post_init__(self) -> None:
        """Check."""
        for name in ("speed", "tilt", "body_rate", "moment"):
            limit = frozen_bounds(getattr(self, name), f"envelope.{name}")
            if limit.ndim or limit <= 0:
                raise SpecError(
                    f"envelope.{name} must be one positive number, infinite for no limit; got {limit}"
                )
            object.__setattr__(self, name, float(limit))
