"""Bounds of position and its derivatives per axis, from the problem."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aerobat.arrays import AXES
from aerobat.limits.limit import Asked, Limit, size_of
from aerobat.limits.quantity import PATH_SHAPE, PathQuantity
from aerobat.problem import Limits
from aerobat.problem.limits import DERIVATIVES, UNITS

UP = AXES.index("z")
# the fields that bound each derivative of position, for sentences
FIELDS = ("limits.lower and limits.upper", *(f"limits.{name}" for name in DERIVATIVES[1:]))


def limits(asked: Asked) -> Iterator[Limit]:
    """Yield a limit for each derivative and axis that has a bound."""
    for derivative, (name, unit) in enumerate(zip(DERIVATIVES, UNITS, strict=True)):
        lower, upper = asked.limits.of(derivative)
        for axis in np.flatnonzero(np.isfinite(lower) | np.isfinite(upper)).tolist():
            path = np.zeros(PATH_SHAPE)
            path[derivative, axis] = 1.0
            least, most = float(lower[axis]), float(upper[axis])
            fields = (f"limits.{name}", f"limits.{name}")
            if derivative == 0:
                on_ground = axis == UP and least == asked.environment.ground
                fields = ("environment.ground" if on_ground else "limits.lower", "limits.upper")
            yield Limit(
                name=f"{name} {AXES[axis]}",
                unit=unit,
                quantity=PathQuantity(path),
                lower=least,
                upper=most,
                fields=fields,
                size=size_of(least, most),
            )


def field_with_value(derivative: int, limits: Limits) -> str:
    """Return the fields that bound a derivative of position; except for position with the smallest bound."""
    field = FIELDS[derivative]
    return f"{field} ({np.min(limits.of(derivative)[1]):g} {UNITS[derivative]})" if derivative else field
