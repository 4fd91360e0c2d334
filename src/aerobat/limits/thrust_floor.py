"""A lower limit of the specific thrust, which keeps the attitude determined.

Where thrust vanishes, it determines no attitude, and commands grow with 1/|f| nearby. Planners avoid this
region. A certificate does not need the limit: it reports where the attitude is undetermined.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

from aerobat.limits.limit import Asked, Limit
from aerobat.limits.quantity import SPECIFIC_THRUST, PathQuantity

MIN_FRACTION = 0.02  # of the largest specific thrust; with less, programs of fast flips diverged


def limits(asked: Asked) -> Iterator[Limit]:
    """Yield the limit for a problem with a vehicle."""
    if asked.vehicle is None:
        return
    yield Limit(
        name="specific thrust",
        unit="m/s²",
        quantity=PathQuantity.of_measure(SPECIFIC_THRUST),
        lower=MIN_FRACTION * asked.vehicle.max_specific_thrust,
        upper=inf,
        fields=("", ""),
        size=asked.environment.gravity,
        is_proven=False,
    )
