"""What a link and a vehicle tell each other: goals, modes, and how the vehicle is seen; ENU and FLU."""

from __future__ import annotations

from enum import StrEnum
from math import atan2
from typing import NamedTuple

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.kernels.ops import Quaternion, Vector
from aerobat.kernels.rigid_body import Body


class Mode(StrEnum):
    """Who says where to go: a client that streams goals, or the autopilot itself."""

    HOLD = "hold"
    TAKEOFF = "takeoff"
    LAND = "land"
    OFFBOARD = "offboard"


_STILL: Array = np.zeros(3)
_STILL.flags.writeable = False


class PositionGoal(NamedTuple):
    """A point to be at, moving as it says."""

    position: Array  # [m], (3,)
    velocity: Array  # [m/s], (3,)
    acceleration: Array  # [m/s²], (3,)
    yaw: float  # [rad] of the body's x axis about the vertical, from east
    jerk: Array = _STILL  # [m/s³], (3,)


class PathGoal(NamedTuple):
    """A point of a path, with the attitude that it is passed in; all of it in world axes."""

    position: Array  # [m], (3,)
    velocity: Array  # [m/s], (3,)
    acceleration: Array  # [m/s²], (3,)
    jerk: Array  # [m/s³], (3,)
    q_world_body: Array  # (4,)
    omega: Array  # [rad/s], (3,)
    omega_dot: Array  # [rad/s²], (3,)

    @classmethod
    def upright(cls, goal: PositionGoal, gravity: float) -> PathGoal:
        """A point of a way near a hover, leaning as its acceleration asks; its rates change slowly."""
        thrust = goal.acceleration + gravity * so3.UP
        size = float(np.linalg.norm(thrust))
        heading = so3.about_axis(so3.UP, goal.yaw)
        q = so3.multiply(so3.smallest_rotation(so3.UP, thrust / size), heading)
        omega = so3.cross(thrust, goal.jerk) / size**2
        return cls(goal.position, goal.velocity, goal.acceleration, goal.jerk, q, omega, _STILL)


class PathPiece(NamedTuple):
    """A short piece of a path, as the two points at its ends."""

    begin: PathGoal
    end: PathGoal
    stamp: float  # [s] when it begins
    duration: float  # [s]


class AttitudeGoal(NamedTuple):
    """An attitude to have, turning as it says, at a collective thrust."""

    q_world_body: Quaternion
    omega_body: Vector  # [rad/s]
    thrust: float  # [N] of all rotors


class Observed(NamedTuple):
    """A vehicle as telemetry tells it."""

    time: float  # [s] when it was so, by the link's clock
    body: Body


def yaw_of(q_world_body: Array | Quaternion) -> float:
    """The angle of the body's x axis about the vertical, from east [rad]."""
    x, y, _ = so3.axes(q_world_body)[:, 0]
    return atan2(y, x)
