"""Conversions between MAVLink's axes and units and ours.

MAVLink's local frame is NED (x north, y east, z down), its body frame FRD (x forward, y right, z down); ours
are ENU and FLU. World vectors swap x and y and negate z; body vectors negate y and z. For attitudes,
q_ned_frd = q_M ⊗ q_enu_flu ⊗ q_X with half turns about (1, 1, 0)/√2 and about x. Each map is its own inverse,
for attitudes up to the quaternion's sign. MAVLink's yaw is clockwise from north, ours counter-clockwise from
east.

Thrust is a fraction of the maximum collective thrust, assumed linear: T / T_max. An autopilot's T_max follows
from its hover thrust, T_max = m g / fraction: PX4's parameter MPC_THR_HOVER, ArduPilot's MOT_THST_HOVER.
"""

from __future__ import annotations

from math import cos, pi, radians, sqrt

from aerobat.kernels.ops import Quaternion, Vector
from aerobat.kernels.quaternions import multiply

_EARTH = 6_371_000.0  # [m] mean radius
HOME = (47.397742, 8.545594, 488.0)  # [°], [°], [m] place of simulated vehicles, as PX4's own


def swap_world(vector: Vector) -> Vector:
    """Convert ENU to NED, or back."""
    x, y, z = vector
    return y, x, -z


def swap_body(vector: Vector) -> Vector:
    """Convert FLU to FRD, or back."""
    x, y, z = vector
    return x, -y, -z


def swap_attitude(q: Quaternion) -> Quaternion:
    """Convert the attitude of FLU in ENU to that of FRD in NED, or back; with w ≥ 0."""
    to_ned = (0.0, sqrt(0.5), sqrt(0.5), 0.0)
    w, x, y, z = multiply(multiply(to_ned, q), (0.0, 1.0, 0.0, 0.0))
    sign = -1.0 if w < 0.0 else 1.0
    return sign * w, sign * x, sign * y, sign * z


def swap_yaw(yaw: float) -> float:
    """Convert yaw from east counter-clockwise to yaw from north clockwise, or back [rad], in [-π, π)."""
    return (1.5 * pi - yaw) % (2 * pi) - pi


def to_global(position: Vector) -> tuple[int, int, float]:
    """Return latitude and longitude [1e-7 °] and altitude [m] of a place in ENU about HOME (flat earth)."""
    latitude, longitude, altitude = HOME
    x, y, z = position
    degree = _EARTH * radians(1.0)
    north, east = latitude + y / degree, longitude + x / (degree * cos(radians(latitude)))
    return round(1e7 * north), round(1e7 * east), altitude + z


def from_global(latitude: int, longitude: int, altitude: float) -> Vector:
    """Return the inverse of `to_global`."""
    degree = _EARTH * radians(1.0)
    x = (1e-7 * longitude - HOME[1]) * degree * cos(radians(HOME[0]))
    return x, (1e-7 * latitude - HOME[0]) * degree, altitude - HOME[2]
