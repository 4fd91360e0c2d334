"""A ceiling on the tilt, the angle between the thrust axis and the vertical.

Tilt is bounded by its cosine, which knows no kink where the body is upright. A ceiling below the horizontal
is a cone of thrusts; the search holds them in the square pyramid inside it.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, inf, pi, radians, sqrt, tan

import numpy as np

from aerobat.limits.limit import Asked, Limit
from aerobat.limits.path_condition import limit_of
from aerobat.limits.quantity import UPRIGHT, PathQuantity
from aerobat.problem.condition import Condition, Quantity
from aerobat.so3 import UP

FIELD = "limits.max_tilt"
STEEPEST = radians(86.0)  # of a cone that a pyramid stands for: beyond, its faces are all but upright


def limits(asked: Asked) -> Iterator[Limit]:
    """Yield the one limit, where the problem has one."""
    most = asked.limits.max_tilt
    if most < pi:
        yield Limit(
            name="tilt",
            unit="rad",
            quantity=PathQuantity.of_measure(UPRIGHT),
            lower=cos(most),
            upper=inf,
            fields=(FIELD, FIELD),
            size=1.0,
            search=tuple(_pyramid(asked, most)),
        )


def _pyramid(asked: Asked, tilt: float) -> Iterator[Limit]:
    """Yield the faces of the pyramid of thrusts inside the cone of a tilt [rad], which holds none level."""
    if tilt <= STEEPEST:
        for axis in (*np.eye(3)[:2], *-np.eye(3)[:2]):
            face = Condition(Quantity.SPECIFIC_THRUST, axis - tan(tilt) / sqrt(2.0) * UP, upper=0.0)
            yield limit_of(face, asked.balance)
