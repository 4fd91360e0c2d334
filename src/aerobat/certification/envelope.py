"""Limits that a flight shall stay within, beside those of the rotors."""

from __future__ import annotations

import numpy as np

from aerobat.declaration import Limit, declared
from aerobat.problem import Condition, Limits

NO_LIMITS = Limits()


@declared
class Envelope:
    """Limits over continuous time; infinite where there is none.

    `limits` bounds position and its derivatives per axis, as a problem does; `conditions` hold throughout.
    """

    speed: Limit = np.inf  # [m/s] |v|
    tilt: Limit = np.inf  # [rad] between the thrust axis and the vertical; beyond pi it limits nothing
    body_rate: Limit = np.inf  # [rad/s] |ω|
    moment: Limit = np.inf  # [N·m] |M|
    limits: Limits = NO_LIMITS
    conditions: tuple[Condition, ...] = ()
