"""Braking paths of an autopilot, from any motion to a hover, for one vehicle or many."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval
from numpy.typing import ArrayLike

from aerobat import so3
from aerobat.arrays import Array
from aerobat.engines.pytree import components
from aerobat.kernels.control_loops import Lookahead, ReferencePoint
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

MIN_FLOOR = 0.5  # [m] height above the ground below which no hover is aimed at
_MIN_DURATION = 0.2  # [s] shortest duration of braking
_PEAK_RATIO = 1.5  # [-] peak deceleration times duration over initial speed, of the polynomial
_BRAKING_FRACTION = 0.8  # [-] fraction used of the deceleration that thrust can give beyond hovering
_GRAVITY_FRACTION = 0.7  # [-] fraction of gravity with which a climb is ended


class Braking(NamedTuple):
    """Straight braking paths, raised by r: p = p₀ + v T (s − s³ + s⁴/2) + r (10 s³ − 15 s⁴ + 6 s⁵)."""

    durations: Array  # [s] T, (...)
    coefficients: Array  # [m] of s⁰ to s⁵, (..., 6, 3)

    @classmethod
    def of(cls, position: Array, velocity: Array, vehicle: Vehicle, gravity: float, floor: float) -> Braking:
        """Return the paths by which a vehicle brakes as hard as it can.

        Args:
            position: at first [m], (..., 3).
            velocity: at first [m/s], (..., 3).
            vehicle: of which the maximum thrust and the mass are used.
            gravity: [m/s²].
            floor: the height [m] below which a path must not end.
        """
        deceleration = _BRAKING_FRACTION * (vehicle.max_specific_thrust - gravity)
        needed = np.linalg.norm(velocity, axis=-1) / deceleration
        needed = np.maximum(needed, velocity[..., 2] / (_GRAVITY_FRACTION * gravity))
        durations = np.maximum(_PEAK_RATIO * needed, _MIN_DURATION)
        reach = durations[..., None] * velocity
        raised = np.zeros_like(position)
        raised[..., 2] = np.maximum(floor - (position + 0.5 * reach)[..., 2], 0.0)
        zero = np.zeros_like(position)
        rows = (position, reach, zero, 10.0 * raised - reach, 0.5 * reach - 15.0 * raised, 6.0 * raised)
        return cls(durations, np.stack(rows, axis=-2))

    def at(self, since: Array) -> tuple[Array, Array, Array, Array]:
        """Return position to jerk [m/s^k] at times [s] (T,), (T, ..., 3) each; at rest after the end."""
        each = since.reshape(-1, *(1,) * self.durations.ndim)
        s = np.minimum(each / self.durations, 1.0)[..., None]
        parts: list[Array] = []
        rates = np.moveaxis(self.coefficients, -2, 0)
        for _ in range(4):
            parts.append(np.asarray(polyval(s, rates, tensor=False), dtype=np.float64))
            rates = polyder(rates) / self.durations[..., None]
        parts[3] = np.where(s < 1.0, parts[3], 0.0)  # jerk is discontinuous at the end
        return parts[0], parts[1], parts[2], parts[3]

    @property
    def trajectory(self) -> Trajectory:
        """The path of one vehicle."""
        return Trajectory(np.array([self.durations]), self.coefficients[None])


def nearest_heading(q_world_body: Array) -> Array:
    """Return the yaw [rad] (...) of the upright attitudes that are nearest to given attitudes (..., 4).

    Unlike the heading of the body's x axis, this yaw does not jump where that axis is vertical.
    """
    return 2.0 * np.arctan2(q_world_body[..., 3], q_world_body[..., 0])


def point_reference(
    position: Array, velocity: Array, acceleration: Array, jerk: Array, yaw: ArrayLike, gravity: float
) -> ReferencePoint:
    """Return references of a moving point; the controller tilts the vehicle as the acceleration requires.

    Args:
        position: [m], (..., 3).
        velocity: [m/s], (..., 3).
        acceleration: [m/s²], (..., 3).
        jerk: [m/s³], (..., 3).
        yaw: of the body's x axis from east [rad], (...) or one for all.
        gravity: [m/s²].
    """
    zero = components(np.zeros_like(position))
    half = 0.5 * np.broadcast_to(yaw, position.shape[:-1])
    q = (np.cos(half), np.zeros_like(half), np.zeros_like(half), np.sin(half))
    return ReferencePoint(
        components(position),
        components(velocity),
        components(acceleration + gravity * so3.UP),
        components(jerk),
        q,
        zero,
        zero,
        Lookahead(np.zeros(position.shape[:-1]), zero, zero),
    )
