"""Routes outside of maneuvers, from hover to hover or to the ground."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from aerobat.arrays import Array
from aerobat.kernels.control_loops import ReferencePoint
from aerobat.links.goals import PositionGoal
from aerobat.simulation.autopilot.braking import point_reference
from aerobat.trajectory import Trajectory, minimum_effort

SPEED = 2.0  # [m/s] on the way from hover to hover
DESCENT_SPEED = 1.0  # [m/s] of a landing
_MIN_DURATION = 0.2  # [s] shortest duration of a route
_PEAK_SPEED = 15.0 / 8.0  # [-] peak speed of the quintic from rest to rest, over its mean speed
_PEAK_ACCELERATION = 10.0 / sqrt(3.0)  # [-] its peak acceleration, times duration squared over length


class Route(NamedTuple):
    """A route with its start time; at its end the vehicle hovers."""

    path: Trajectory
    began: float  # [s]
    yaw: float  # [rad] from east

    @property
    def end(self) -> Array:
        """The position at the end of the route [m], (3,)."""
        return self.path.evaluate(self.path.duration)

    def goal(self, now: float) -> PositionGoal:
        """Return the goal at a time [s]."""
        return goal_on(self.path, now - self.began, self.yaw)

    def reference(self, times: Array, gravity: float) -> ReferencePoint:
        """Return references for a controller at times [s], leaves (T,)."""
        return point_reference(*_motion(self.path, times - self.began), self.yaw, gravity)


def rest_to_rest(
    start: Array, goal: Array, max_speed: float = SPEED, max_acceleration: float = 2.0
) -> Trajectory:
    """Return the straight minimum-jerk route between two hovers.

    Args:
        start: initial position [m], (3,).
        goal: final position [m], (3,).
        max_speed: largest speed [m/s].
        max_acceleration: largest acceleration [m/s²].
    """
    length = float(np.linalg.norm(np.asarray(goal) - start))
    by_speed = _PEAK_SPEED * length / max_speed
    by_acceleration = sqrt(_PEAK_ACCELERATION * length / max_acceleration)
    ends = np.zeros((2, 3, 3))
    ends[0, 0], ends[1, 0] = start, goal
    return minimum_effort(ends, [max(by_speed, by_acceleration, _MIN_DURATION)])


def straight_down(start: Array, ground: float) -> Trajectory:
    """Return the route of a landing from a hover at `start` [m], (3,), to the ground at a height [m].

    It ends 0.3 m below the ground, so that the vehicle is still moving at touchdown.
    """
    return rest_to_rest(start, np.array([start[0], start[1], ground - 0.3]), DESCENT_SPEED)


def goal_on(route: Trajectory, time: float, yaw: float) -> PositionGoal:
    """Return the goal at a time [s] since a route's start, at a yaw [rad]."""
    position, velocity, acceleration, jerk = _motion(route, np.array(time))
    return PositionGoal(position, velocity, acceleration, yaw, jerk)


def _motion(route: Trajectory, times: Array) -> tuple[Array, Array, Array, Array]:
    """Return position to jerk [m/s^k] at times [s] (...) since a route's start; constant beyond its ends."""
    flat = route.flat(np.clip(times, 0.0, route.duration))
    jerk = np.where((times < route.duration)[..., None], flat.jerk, 0.0)  # jerk is discontinuous at the end
    return flat.position, flat.velocity, flat.acceleration, jerk
