"""Ways outside a maneuver, from hover to hover."""

from __future__ import annotations

from math import sqrt

import numpy as np

from aerobat.arrays import Array
from aerobat.links.goals import PositionGoal
from aerobat.trajectory import Trajectory, minimum_effort

_SHORTEST = 0.2  # [s] of any route, however near its end is
_PEAK_SPEED = 15.0 / 8.0  # [-] of the quintic from rest to rest, over its mean speed
_PEAK_ACCELERATION = 10.0 / sqrt(3.0)  # [-] likewise, times duration squared over length


def rest_to_rest(start: Array, goal: Array, max_speed: float, max_acceleration: float) -> Trajectory:
    """The straight way between two hovers, of least jerk.

    Args:
        start: from where [m], (3,).
        goal: to where [m], (3,).
        max_speed: that it reaches at most [m/s].
        max_acceleration: likewise [m/s²].
    """
    length = float(np.linalg.norm(np.asarray(goal) - start))
    by_speed = _PEAK_SPEED * length / max_speed
    by_acceleration = sqrt(_PEAK_ACCELERATION * length / max_acceleration)
    ends = np.zeros((2, 3, 3))
    ends[0, 0], ends[1, 0] = start, goal
    return minimum_effort(ends, [max(by_speed, by_acceleration, _SHORTEST)])


def goal_on(route: Trajectory, time: float, yaw: float) -> PositionGoal:
    """The goal at a time [s] on a route to a hover, at its end from then on, at a yaw [rad]."""
    flat = route.flat(min(time, route.duration))
    jerk = flat.jerk if time < route.duration else np.zeros(3)  # it jumps to rest
    return PositionGoal(flat.position, flat.velocity, flat.acceleration, yaw, jerk)
