"""Goals, modes and observed states that a link and a vehicle exchange; axes ENU and FLU."""

from __future__ import annotations

from enum import StrEnum
from math import atan2, hypot
from typing import NamedTuple

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.kernels.ops import Quaternion, Vector
from aerobat.kernels.rigid_body import Body


class Mode(StrEnum):
    """The source of goals: a client that streams them (offboard), or the autopilot itself."""

    HOLD = "hold"
    TAKEOFF = "takeoff"
    LAND = "land"
    OFFBOARD = "offboard"


_MAX_VALUE = 1e6  # [m], [m/s] and [rad/s] largest plausible values
_NORM_TOLERANCE = 1e-2  # [-] tolerance of the norm of a quaternion, which may be sent with few decimals
TAKEOFF_THRESHOLD = 0.01  # [m] height of a goal above the ground that means take-off
ZERO: Array = np.zeros(3)
ZERO.flags.writeable = False


class PositionGoal(NamedTuple):
    """A point to track, with its derivatives."""

    position: Array  # [m], (3,)
    velocity: Array  # [m/s], (3,)
    acceleration: Array  # [m/s²], (3,)
    yaw: float  # [rad] of the body's x axis about the vertical, from east
    jerk: Array = ZERO  # [m/s³], (3,)

    @classmethod
    def hover(cls, position: Array, yaw: float) -> PositionGoal:
        """Return the goal of a hover at a position [m], (3,), and a yaw [rad]."""
        return cls(position, ZERO, ZERO, yaw)


class PathGoal(NamedTuple):
    """A point of a path, with its attitude; all in world axes."""

    position: Array  # [m], (3,)
    velocity: Array  # [m/s], (3,)
    acceleration: Array  # [m/s²], (3,)
    jerk: Array  # [m/s³], (3,)
    q_world_body: Array  # (4,)
    omega: Array  # [rad/s], (3,)
    omega_dot: Array  # [rad/s²], (3,)

    @classmethod
    def upright(cls, goal: PositionGoal, gravity: float) -> PathGoal:
        """Return the goal with the attitude and the rates that its acceleration and jerk require."""
        thrust = goal.acceleration + gravity * so3.UP
        size = float(np.linalg.norm(thrust))
        heading = so3.about_axis(so3.UP, goal.yaw)
        q = so3.multiply(so3.smallest_rotation(so3.UP, thrust / size), heading)
        omega = so3.cross(thrust, goal.jerk) / size**2
        return cls(goal.position, goal.velocity, goal.acceleration, goal.jerk, q, omega, ZERO)


class PathPiece(NamedTuple):
    """A short piece of a path, as the two points at its ends."""

    begin: PathGoal
    end: PathGoal
    stamp: float  # [s] when it begins
    duration: float  # [s]


class AttitudeGoal(NamedTuple):
    """An attitude to track, with its body rates and the collective thrust."""

    q_world_body: Quaternion
    omega_body: Vector  # [rad/s]
    thrust: float  # [N] of all rotors


class Observed(NamedTuple):
    """A vehicle's state from its telemetry."""

    time: float  # [s] by the link's clock
    body: Body


def observed(
    time: float, position: Vector, q_world_body: Quaternion, velocity_body: Vector, omega_body: Vector
) -> Observed | None:
    """Return the state in a message of telemetry, or None for numbers that no vehicle can have.

    Every number must be finite and at most 10⁶, and the attitude a unit quaternion within 1 %.

    Args:
        time: The time of the state [s], by the link's clock.
        position: World [m].
        q_world_body: The attitude, body to world.
        velocity_body: The velocity in the body's axes [m/s].
        omega_body: The rate in the body's axes [rad/s].
    """
    numbers = np.array([*position, *velocity_body, *omega_body])
    norm = hypot(*q_world_body)
    if not (np.abs(numbers).max() <= _MAX_VALUE and abs(norm - 1.0) <= _NORM_TOLERANCE):  # false for NaN, too
        return None
    velocity = so3.rotate(np.array(q_world_body) / norm, np.array(velocity_body))
    w, x, y, z = (part / norm for part in q_world_body)
    return Observed(time, Body(position, tuple(velocity.tolist()), (w, x, y, z), omega_body))


def yaw_of(q_world_body: Array | Quaternion) -> float:
    """Return the angle of the body's x axis about the vertical, from east [rad]."""
    x, y, _ = so3.axes(q_world_body)[:, 0]
    return atan2(y, x)
