"""The command f + τ f' of every rotor with lag τ, limited to the rotor's thrust range."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from aerobat.limits import rotor_thrust
from aerobat.limits.limit import Asked, Limit
from aerobat.limits.quantity import WRENCH, PathQuantity


def limits(asked: Asked) -> Iterator[Limit]:
    """Yield a limit for each rotor with lag."""
    lags = () if asked.vehicle is None else asked.vehicle.lags.tolist()
    for thrust, lag in zip(rotor_thrust.limits(asked), lags, strict=True):
        if lag > 0.0:
            weights = thrust.quantity.measured[WRENCH]
            command = PathQuantity.of_wrench(weights, lag * weights)
            yield replace(thrust, name="command", quantity=command, is_implied=False)
