"""A quantity along a path: what every limit is about, linear in what is measured at one instant.

An instant has two kinds of numbers: the derivatives of position, which are polynomials in time, and what
flatness makes of them, the measures below. Whoever evaluates the measures, in floats, complex steps,
symbols or Chebyshev series with proven errors, evaluates every limit.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from aerobat.arrays import Array

PATH_SHAPE = (6, 3)  # position to crackle, in the world
WRENCH = slice(0, 4)  # collective thrust [N] and moment [N·m], body axes
WRENCH_RATE = slice(4, 8)  # their time derivatives [N/s, N·m/s]
SPECIFIC_THRUST = 8  # |f| [m/s²]
BODY_RATE = 9  # |ω| [rad/s]
UPRIGHT = 10  # cosine of the tilt, the angle between the thrust axis and the vertical [-]
MEASURES = 11


@dataclass(frozen=True, eq=False)
class PathQuantity:
    """The sum of `path` times position and its derivatives and of `measured` times the measures."""

    path: Array = field(default_factory=lambda: np.zeros(PATH_SHAPE))  # (6, 3)
    measured: Array = field(default_factory=lambda: np.zeros(MEASURES))  # (11,)
    constant: float = 0.0

    @classmethod
    def of_wrench(cls, wrench: ArrayLike, rate: ArrayLike = 0.0) -> PathQuantity:
        """Return weights (4,) times the wrench, and others (4,) times its time derivative."""
        measured = np.zeros(MEASURES)
        measured[WRENCH], measured[WRENCH_RATE] = wrench, rate
        return cls(measured=measured)

    @classmethod
    def of_measure(cls, measure: int) -> PathQuantity:
        """Return one measure by its index."""
        return cls(measured=np.eye(MEASURES)[measure])

    @property
    def derivatives(self) -> tuple[int, ...]:
        """The derivatives of position that it is linear in."""
        return tuple(np.flatnonzero(self.path.any(axis=1)).tolist())

    @property
    def measures(self) -> tuple[int, ...]:
        """The indices of the measures that it is linear in."""
        return tuple(np.flatnonzero(self.measured).tolist())

    @property
    def is_of_path(self) -> bool:
        """True if it is linear in position and its derivatives."""
        return not self.measured.any()
