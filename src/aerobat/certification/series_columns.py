"""The columns of a certificate's series: certified quantities, and what limits of a problem add to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aerobat.arrays import Array
from aerobat.certification import quantities
from aerobat.limits.limit import Limit
from aerobat.vehicle import Vehicle


@dataclass(frozen=True)
class SeriesColumns:
    """The columns: those of `quantities.values`, and these behind them, in this order."""

    derived: Sequence[Limit] = ()  # on measures that follow from these
    on_thrust: Sequence[Limit] = ()  # on the specific thrust, where drag is unequal along body x and y
    with_axis: bool = False  # whether the three components of the thrust axis are among them

    def scale(self, vehicle: Vehicle) -> Array:
        """Return the magnitudes that count as large, (Q,); of the thrust axis that of the tilt's cosine."""
        stated, limits = quantities.scales(vehicle), (*self.derived, *self.on_thrust)
        cos_tilt = stated[len(vehicle.rotors) + 1]
        return np.array([*stated, *(limit.size for limit in limits), *[cos_tilt] * (3 * self.with_axis)])
