"""A floor under the specific thrust, which keeps the attitude determined.

Where thrust vanishes, no attitude follows from it, and commands grow with 1/|f| on the way there. Planners
keep off it; a certificate needs no such floor, it says where an attitude is undetermined.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

from aerobat.limits.limit import Asked, Limit
from aerobat.limits.quantity import SPECIFIC_THRUST, PathQuantity

FRACTION = 0.02  # of the largest specific thrust: with less, fast flips lost their way in programs


def limits(asked: Asked) -> Iterator[Limit]:
    """Yield the one limit, of a vehicle's motion."""
    if asked.vehicle is None:
        return
    yield Limit(
        name="specific thrust",
        unit="m/s²",
        quantity=PathQuantity.of_measure(SPECIFIC_THRUST),
        lower=FRACTION * asked.vehicle.max_specific_thrust,
        upper=inf,
        fields=("", ""),
        size=asked.environment.gravity,
        is_proven=False,
    )
