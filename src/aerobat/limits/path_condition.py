"""Conditions of a maneuver along the whole path: position to specific thrust along a direction.

With drag that differs along body x and y the specific thrust is nonlinear in the path, and planners constrain
the specific thrust of the mean drag. A condition that thrust must not point down is also constrained exactly,
as a bound on the tilt.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import inf

import numpy as np

from aerobat.flatness.inverse_dynamics import has_unequal_drag
from aerobat.limits.limit import MIN_SIZE, Asked, Limit
from aerobat.limits.quantity import PATH_SHAPE, UPRIGHT, PathQuantity
from aerobat.problem.condition import Condition, ForceBalance, Quantity
from aerobat.problem.limits import UNITS

FIELD = "path_constraints"  # of the maneuver


def limits(asked: Asked) -> Iterator[Limit]:
    """Yield a limit for each condition."""
    for condition in asked.conditions:
        limit = limit_of(condition, asked.balance)
        yield limit
        if asked.vehicle is not None and has_unequal_drag(asked.vehicle) and _is_upright(condition):
            upright = PathQuantity.of_measure(UPRIGHT)
            yield replace(limit, quantity=upright, size=1.0, is_proven=False)


def _is_upright(condition: Condition) -> bool:
    """Return True for a condition that only requires the specific thrust to point upwards."""
    x, y, z = condition.direction.tolist()
    asks_sign = condition.lower == 0.0 and condition.upper == inf
    return condition.quantity is Quantity.SPECIFIC_THRUST and x == y == 0.0 < z and asks_sign


def limit_of(condition: Condition, balance: ForceBalance) -> Limit:
    """Return a condition as a limit; drag is included where the condition is about thrust."""
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
        size=bound.scale if bound.scale > MIN_SIZE else 1.0,
    )
