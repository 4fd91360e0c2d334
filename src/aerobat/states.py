"""Words that the packages share: what a body does, what a trajectory asks, what acts on a body, and when.

Every array may carry leading axes (time, vehicles); they broadcast.
"""

from __future__ import annotations

from dataclasses import dataclass

from aerobat.arrays import Array
from aerobat.declaration import by_value, validated

STANDARD_GRAVITY = 9.81  # [m/s²] as the paper has it


@validated
@by_value
class BodyState:
    """The state of a rigid body."""

    position: Array  # [m] world, (..., 3)
    velocity: Array  # [m/s] world, (..., 3)
    q_world_body: Array  # unit quaternion (w, x, y, z), (..., 4)
    omega_body: Array  # [rad/s] body axes, (..., 3)


@validated
@by_value
class FlatState:
    """Position and its derivatives, the flat outputs of a multirotor; all world frame, (..., 3)."""

    position: Array  # [m]
    velocity: Array  # [m/s]
    acceleration: Array  # [m/s²]
    jerk: Array  # [m/s³]
    snap: Array  # [m/s⁴]


@validated
@by_value
class Wrench:
    """The rotors' effect on the body: collective thrust along +z and moments, body frame."""

    thrust: Array  # [N], (...)
    moment_body: Array  # [N·m], (..., 3)


@validated
@by_value
class Setpoint:
    """A trajectory's demand on a vehicle: the flat state and all that flatness derives from it."""

    flat: FlatState
    q_world_body: Array  # (..., 4), sign continuous along time
    omega_body: Array  # [rad/s], (..., 3)
    omega_dot_body: Array  # [rad/s²], (..., 3)
    wrench: Wrench


@dataclass(frozen=True)
class TimeInterval:
    """An interval of time [s]."""

    start: float
    end: float
