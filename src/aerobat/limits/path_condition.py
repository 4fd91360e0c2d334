"""What a maneuver asks throughout: position, velocity, acceleration or specific thrust along a direction."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aerobat.limits.limit import SMALLEST_SIZE, Asked, Limit
from aerobat.limits.quantity import PATH_SHAPE, PathQuantity
from aerobat.problem.condition import Condition, ForceBalance
from aerobat.problem.problem import UNITS

FIELD = "path_constraints"  # of the maneuver


def limits(asked: Asked) -> Iterator[Limit]:
    """Yield a limit for each condition."""
    for condition in asked.conditions:
        yield limit_of(condition, asked.balance)


def limit_of(condition: Condition, balance: ForceBalance) -> Limit:
    """Return a condition as a limit; drag is counted where it is about thrust."""
    bound = condition.bound(balance)
    path = np.zeros(PATH_SHAPE)
    path[: len(bound.weights)] = bound.weights
    return Limit(
        name=condition.name,
        unit=UNITS[condition.quantity.derivative],
        quantity=PathQuantity(path, constant=bound.constant),
        lower=bound.lower,
        upper=bound.upper,
        fields=(FIELD, FIELD),
        size=bound.scale if bound.scale > SMALLEST_SIZE else 1.0,
    )
