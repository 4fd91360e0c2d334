"""What a link and a vehicle tell each other: goals, modes, and how the vehicle is seen; ENU and FLU."""

from __future__ import annotations

from enum import StrEnum
from math import atan2
from typing import NamedTuple

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


class PositionGoal(NamedTuple):
    """A point to be at, moving as it says."""

    position: Array  # [m], (3,)
    velocity: Array  # [m/s], (3,)
    acceleration: Array  # [m/s²], (3,)
    yaw: float  # [rad] of the body's x axis about the vertical, from east


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
