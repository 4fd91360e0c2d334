"""Limits of a flight in addition to those of the rotors."""

from __future__ import annotations

import numpy as np

from aerobat.declaration import Limit, TiltLimit, declared
from aerobat.problem import Condition, EndState, Limits
from aerobat.problem.planned_passage import PlannedPassage, PlannedWaypoint


@declared
class Envelope:
    """Limits over continuous time; infinite where there is none.

    `limits` bounds position and its derivatives per axis, as a problem does. `conditions` hold throughout,
    `passages` and `waypoints` at their instants, `start` and `goal` at the ends of the path. A `closed` path
    continues from its end at its start.
    """

    speed: Limit = np.inf  # [m/s] |v|
    tilt: TiltLimit = np.inf  # [rad] between the thrust axis and the vertical; beyond pi it limits nothing
    body_rate: Limit = np.inf  # [rad/s] |ω|
    moment: Limit = np.inf  # [N·m] |M|
    limits: Limits = Limits()
    conditions: tuple[Condition, ...] = ()
    passages: tuple[PlannedPassage, ...] = ()
    waypoints: tuple[PlannedWaypoint, ...] = ()
    start: EndState | None = None
    goal: EndState | None = None
    closed: bool = False
