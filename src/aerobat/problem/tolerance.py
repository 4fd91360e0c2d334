"""Tolerances by which flights are judged where neither a gate nor a radius sets the tolerance."""

from __future__ import annotations

from collections.abc import Mapping
from math import radians
from typing import ClassVar

from aerobat.declaration import Positive, declared
from aerobat.problem.condition import ConeAngle


@declared
class Tolerance:
    """Largest errors of a successful flight, where neither a gate nor a radius sets the tolerance.

    The position is checked at the goal, at stages with a place and, if the problem has no gate or radius,
    along the whole path. The attitude is that of the thrust axis, checked at stages that require an attitude.
    """

    position: Positive = 0.1  # [m] from the plan
    attitude: ConeAngle = radians(10.0)  # [rad] between the thrust axis and the plan's

    SHORTHANDS: ClassVar[Mapping[str, str]] = {"attitude_deg": "[deg] `attitude` in degrees (10)"}
