"""The quantity of a limit, linear in the path's derivatives and in flatness measures at one instant.

The derivatives of position are polynomials in time. The measures below follow from them by differential
flatness. Code that evaluates the measures (in floats, complex steps, symbols or Chebyshev series with proven
errors) can evaluate every limit.
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
    """The sum of `path` times position and derivatives, `measured` times the measures, and `constant`."""

    path: Array = field(default_factory=lambda: np.zeros(PATH_SHAPE))  # (6, 3)
    measured: Array = field(default_factory=lambda: np.zeros(MEASURES))  # (11,)
    constant: float = 0.0

    @classmethod
    def of_wrench(cls, wrench: ArrayLike, rate: ArrayLike = 0.0) -> PathQuantity:
        """Return the quantity with weights (4,) on the wrench and on its time derivative."""
        measured = np.zeros(MEASURES)
        measured[WRENCH], measured[WRENCH_RATE] = wrench, rate
        return cls(measured=measured)

    @classmethod
    def of_measure(cls, measure: int) -> PathQuantity:
        """Return the quantity that is one measure, by its index."""
        return cls(measured=np.eye(MEASURES)[measure])

    @property
    def derivatives(self) -> tuple[int, ...]:
        """The derivatives of position that the quantity depends on."""
        return tuple(np.flatnonzero(self.path.any(axis=1)).tolist())

    @property
    def measures(self) -> tuple[int, ...]:
        """The indices of the measures that the quantity depends on."""
        return tuple(np.flatnonzero(self.measured).tolist())

    @property
    def is_of_path(self) -> bool:
        """True if the quantity depends only on position and its derivatives."""
        return not self.measured.any()


def quantity_name(quantity: str, rotor: int | None) -> str:
    """Return a quantity in words, with the number of its rotor if it has one."""
    return quantity if rotor is None else f"{quantity} of rotor {rotor}"
