"""An upper limit of the tilt, the angle between the thrust axis and the vertical.

The limit is written for the cosine of the tilt, which is smooth at zero tilt. A limit below 90° is a cone of
thrusts; the mixed-integer search uses the square pyramid inside the cone.
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
# largest tilt for which the pyramid is used; beyond, its faces are almost vertical
MAX_PYRAMID_TILT = radians(86.0)


def limits(asked: Asked) -> Iterator[Limit]:
    """Yield the tilt limit if the problem has one."""
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
    """Yield the faces of the pyramid inside the cone of a tilt [rad]; none above MAX_PYRAMID_TILT."""
    if tilt <= MAX_PYRAMID_TILT:
        for axis in (*np.eye(3)[:2], *-np.eye(3)[:2]):
            face = Condition(Quantity.SPECIFIC_THRUST, axis - tan(tilt) / sqrt(2.0) * UP, upper=0.0)
            yield limit_of(face, asked.balance)
