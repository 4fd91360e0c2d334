"""The thrust of every rotor, within what it gives."""

from __future__ import annotations

from collections.abc import Iterator

from aerobat.limits.limit import Asked, Limit
from aerobat.limits.quantity import PathQuantity
from aerobat.vehicle import mixer

FIELDS = ("min_thrust", "max_thrust")
HOVER_SHARE = 0.5  # of a hover's thrust: with more kept at the lower end a vehicle cannot sink


def limits(asked: Asked) -> Iterator[Limit]:
    """Yield a limit for each rotor. Where it lags, its command's limits imply it."""
    vehicle = asked.vehicle
    if vehicle is None:
        return
    below = HOVER_SHARE * asked.environment.gravity / vehicle.max_specific_thrust
    for i, (rotor, share) in enumerate(zip(vehicle.rotors, mixer(vehicle), strict=True)):
        yield Limit(
            name="thrust",
            unit="N",
            quantity=PathQuantity.of_wrench(share),
            lower=rotor.min_thrust,
            upper=rotor.max_thrust,
            fields=FIELDS,
            size=rotor.max_thrust - rotor.min_thrust,
            rotor=i,
            reserves=(below, 1.0),
            is_implied=rotor.lag > 0.0,
        )
