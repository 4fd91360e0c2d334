"""Tolerances by which flights are judged where neither a gate nor a radius says how exact they must be."""

from __future__ import annotations

from collections.abc import Mapping
from math import radians
from typing import ClassVar

from aerobat.declaration import Positive, declared
from aerobat.problem.condition import ConeAngle


@declared
class Tolerance:
    """Largest errors of a flight that went well, where neither a gate nor a radius says how exact it must be.

    The position counts at the goal, at stages that say where they are, and, where no gate or radius is asked,
    along the whole path. The attitude is that of the thrust axis, and counts at stages that ask for one.
    """

    position: Positive = 0.1  # [m] from the plan
    attitude: ConeAngle = radians(10.0)  # [rad] between the thrust axis and the plan's

    SHORTHANDS: ClassVar[Mapping[str, str]] = {"attitude_deg": "[deg] `attitude` in degrees (10)"}
