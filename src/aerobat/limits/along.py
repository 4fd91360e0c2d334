"""The register of limits: all limits along a path, by family."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from aerobat.declaration import shown
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.limits import body_rate, box, path_condition, rotor_command, rotor_thrust, thrust_floor, tilt
from aerobat.limits.limit import Asked, Limit
from aerobat.problem import Condition, Limits
from aerobat.registry import placed
from aerobat.vehicle import Vehicle

Family = Callable[[Asked], Iterator[Limit]]

FAMILIES: list[Family] = [
    rotor_thrust.limits,
    rotor_command.limits,
    thrust_floor.limits,
    body_rate.limits,
    box.limits,
    path_condition.limits,
    tilt.limits,
]


def register_limits(family: Family) -> Family:
    """Register a function that yields limits, as a decorator; all planners and certificates use them.

    Args:
        family: A function from `Asked` (vehicle, environment, and the problem's bounds) to the limits that
            follow.
    """
    FAMILIES.append(family)
    return family


def limits_along(
    vehicle: Vehicle | None,
    environment: Environment,
    limits: Limits,
    conditions: tuple[Condition, ...],
) -> tuple[Limit, ...]:
    """Return all limits that must hold along a whole path.

    Args:
        vehicle: The vehicle; None means no limits of rotors and body rates, and no drag.
        environment: Gravity, wind and ground.
        limits: The bounds per axis of a problem, including its ground.
        conditions: The conditions of a maneuver that hold throughout.
    """
    asked = Asked(vehicle, environment, limits, conditions)
    return tuple(limit for family in FAMILIES for limit in _limits(family, asked))


def _limits(family: Family, asked: Asked) -> Iterator[Limit]:
    """Yield the limits of a family. Raise SpecError for values that a user's family must not return."""
    try:
        found: Any = family(asked)
        if not isinstance(found, Iterable):
            raise SpecError(f"limits '{family.__name__}' returned {shown(found)}, nothing to iterate over")
        for limit in found:
            if not isinstance(limit, Limit):
                raise SpecError(f"limits '{family.__name__}' yielded {shown(limit)}, not a Limit")
            yield limit
    except SpecError as error:
        raise placed(error, family) from None
