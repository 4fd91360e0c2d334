"""Goals that a link sends to a vehicle, and what it sees of it; world ENU, body FLU."""

from __future__ import annotations

from typing import NamedTuple

from aerobat.arrays import Array
from aerobat.kernels.ops import Quaternion, Vector
from aerobat.kernels.rigid_body import Body


class PositionGoal(NamedTuple):
    """A point to be at, moving as it says."""

    position: Array  # [m], (3,)
    velocity: Array  # [m/s], (3,)
    acceleration: Array  # [m/s²], (3,)
    jerk: Array  # [m/s³], (3,)
    yaw: float  # [rad] about the vertical, from east


class AttitudeGoal(NamedTuple):
    """An attitude to have, turning as it says, at a collective thrust."""

    q_world_body: Quaternion
    omega_body: Vector  # [rad/s]
    thrust: float  # [N] of all rotors


class Observed(NamedTuple):
    """A vehicle as telemetry tells it."""

    time: float  # [s] when it was so, by the link's clock
    body: Body
