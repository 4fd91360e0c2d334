"""Position and its derivatives, each axis within the problem's bounds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aerobat.arrays import AXES
from aerobat.limits.limit import Asked, Limit, size_of
from aerobat.limits.quantity import PATH_SHAPE, PathQuantity
from aerobat.problem.problem import DERIVATIVES, UNITS

UP = AXES.index("z")


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
