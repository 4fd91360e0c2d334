"""The columns of a certificate's series: certified quantities, and those that limits of a problem add."""

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
    """The columns: those of `quantities.values`, followed by these in this order."""

    derived: Sequence[Limit] = ()  # limits on measures that follow from these quantities
    on_thrust: Sequence[Limit] = ()  # limits on the specific thrust, where drag is unequal along body x and y
    with_axis: bool = False  # whether the three components of the thrust axis follow

    def scale(self, vehicle: Vehicle) -> Array:
        """Return values that count as large, (Q,); for the thrust axis that of the cosine of the tilt."""
        stated, limits = quantities.scales(vehicle), (*self.derived, *self.on_thrust)
        cos_tilt = stated[len(vehicle.rotors) + 1]
        return np.array([*stated, *(limit.size for limit in limits), *[cos_tilt] * (3 * self.with_axis)])
