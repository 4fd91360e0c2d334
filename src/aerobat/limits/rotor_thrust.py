"""The thrust of every rotor, limited to its range."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

from aerobat.limits.limit import Asked, Limit
from aerobat.limits.quantity import PathQuantity
from aerobat.vehicle import mixer

FIELDS = ("min_thrust", "max_thrust")
# hover thrust, as a fraction of the maximum, below which the reserve at the lower end is reduced
_LOW_HOVER = 0.25


def limits(asked: Asked) -> Iterator[Limit]:
    """Yield a limit for each rotor. For rotors with lag, the limits of the command imply it."""
    vehicle = asked.vehicle
    if vehicle is None:
        return
    # a reserve as large as hover thrust would prevent sinking
    hover = asked.environment.gravity / vehicle.max_specific_thrust
    room = hover if hover < _LOW_HOVER else inf
    for i, (rotor, weights) in enumerate(zip(vehicle.rotors, mixer(vehicle), strict=True)):
        yield Limit(
            name="thrust",
            unit="N",
            quantity=PathQuantity.of_wrench(weights),
            lower=rotor.min_thrust,
            upper=rotor.max_thrust,
            fields=FIELDS,
            size=rotor.max_thrust - rotor.min_thrust,
            rotor=i,
            rooms=(room, inf),
            is_implied=rotor.lag > 0.0,
        )
