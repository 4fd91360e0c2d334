"""The limit of the body rate, set by the vehicle's flight controller and gyroscopes."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

from aerobat.limits.limit import Asked, Limit
from aerobat.limits.quantity import BODY_RATE, PathQuantity


def limits(asked: Asked) -> Iterator[Limit]:
    """Yield the body rate limit if the vehicle has one."""
    most = inf if asked.vehicle is None else asked.vehicle.max_body_rate
    if most < inf:
        yield Limit(
            name="body rate",
            unit="rad/s",
            quantity=PathQuantity.of_measure(BODY_RATE),
            lower=-inf,
            upper=most,
            fields=("", "max_body_rate"),
            size=most,
            rooms=(inf, inf),
        )
