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
# idle thrust, as a fraction of hover thrust, above which the room is what lies between both. With 75 %, 54 %
# of agile-quad's flights along `line` under `lab` succeeded, now all; of `flip-roll` 24 %, now 94 %.
_HIGH_IDLE = 0.25


def limits(asked: Asked) -> Iterator[Limit]:
    """Yield a limit for each rotor. For rotors with lag, the limits of the command imply it."""
    vehicle = asked.vehicle
    if vehicle is None:
        return
    weight = vehicle.mass * asked.environment.gravity
    for i, (rotor, weights) in enumerate(zip(vehicle.rotors, mixer(vehicle), strict=True)):
        # a reserve as large as hover thrust, or as what lies between idle and hover, would prevent sinking
        room = asked.environment.gravity / vehicle.max_specific_thrust
        if rotor.min_thrust > _HIGH_IDLE * (hover := float(weight * weights[0])):
            room = max(hover - rotor.min_thrust, 0.0) / (rotor.max_thrust - rotor.min_thrust)
        room = room if room < _LOW_HOVER else inf
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
