"""Body rates along pieces, in a frame that is carried along the thrust direction without spin.

Choose fixed axes e1, e2, e3 on a piece, with e3 near the thrust. Let f = (u, v, w) in these axes, n = |f| and
b3 = f/n. The smallest rotation from e3 to b3 turns e1 and e2 into

    x~ = e1 − b3_x g,   y~ = e2 − b3_y g,   g = (e3 + b3)/(1 + b3_z).

The frame without spin is rotated by an angle φ about b3 from x~ and y~. With the rates of `kernels.flatness`
in these axes, φ' = ω_z / (1 + b3_z) (Hanson and Ma, 1995). Body rates across b3 are written as complex
numbers x + i y in x~, y~, times exp(−i φ). As e3 is near b3, 1 + b3_z is never near 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array, xyz
from aerobat.certification.enclosure import chebyshev
from aerobat.kernels import flatness
from aerobat.so3 import UP

ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class ThrustDirectionRates:
    """Body rates along P pieces at N nodes each, in separate axes on each piece."""

    axes: Array  # e1, e2, e3 as columns, (P, 3, 3)
    direction: Array  # b3, world, (P, N, 3)
    omega: ComplexArray  # ω across b3 [rad/s], (P, N)
    omega_dot: ComplexArray  # ω' across b3 [rad/s²], (P, N)
    twist: Array  # φ since the piece's start [rad], (P, N)

    @classmethod
    def along(
        cls, thrust: Array, mean: Array, seconds: Array, basis: chebyshev.Basis
    ) -> ThrustDirectionRates:
        """Compute the rates from f, f', f'' (P, N, 3, 3) at the basis's nodes.

        Args:
            thrust: f, f', f'', world.
            mean: Direction for e3 on each piece, world, (P, 3).
            seconds: Durations of the pieces [s], (P,).
            basis: The basis of interpolation.
        """
        axes = _axes_about(mean)
        n = np.linalg.norm(thrust[..., 0, :], axis=-1)
        local = np.moveaxis(thrust @ axes[:, None], (-2, -1), (0, 1)) / n
        b3, jerk, snap = (tuple(vector) for vector in local)
        rates = flatness.body_rates(b3, jerk, snap)
        omega, omega_dot = (x + 1j * y for x, y in (flatness.tilted(b3, rate) for rate in rates))
        spin = rates[0][2] / (1 + b3[2])
        twist = seconds[:, None] / 2 * chebyshev.integral(spin, basis)
        return cls(axes, thrust[..., 0, :] / n[..., None], omega, omega_dot, twist)

    def carried(self, heading: float) -> Array:
        """Return φ at all nodes (P, N) of a frame that is carried over from piece to piece.

        The initial frame is the smallest rotation from the vertical to b3, turned by `heading`. Where
        directions of neighbouring pieces differ, the frame is turned by the smallest rotation between them.
        """
        first, last = (_frames(self.axes, self.direction[:, node]) for node in (0, -1))
        turned = so3.about_axis(UP, np.array(heading))
        upright = so3.multiply(so3.smallest_rotation(UP, self.direction[0, 0]), turned)
        onto = so3.smallest_rotation(self.direction[:-1, -1], self.direction[1:, 0])
        handed = so3.rotate(onto, last[:-1, :, 0])
        start = np.concatenate([so3.rotate(upright, [1.0, 0.0, 0.0])[None], handed])
        step = np.arctan2(np.sum(start * first[..., 1], axis=-1), np.sum(start * first[..., 0], axis=-1))
        step[1:] += self.twist[:-1, -1]
        return np.asarray(np.cumsum(step)[:, None] + self.twist)

    def body(self, angle: Array) -> tuple[Array, Array]:
        """Return ω and ω' in the axes of a frame at the angles φ (P, N), each (P, N, 3)."""
        back = np.exp(-1j * angle)
        return _flat(back * self.omega), _flat(back * self.omega_dot)

    def with_yaw(self, angle: Array, yaw: Array) -> tuple[Array, Array]:
        """Return ω and ω' of a body turned from that frame by a yaw with two derivatives, (P, N, 3)."""
        without_yaw, without_yaw_dot = map(xyz, self.body(angle + yaw[..., 0]))
        omega, omega_dot = flatness.spun(
            without_yaw, without_yaw_dot, tuple(np.moveaxis(yaw[..., 1:], -1, 0))
        )
        return np.stack(omega, axis=-1), np.stack(omega_dot, axis=-1)


def _axes_about(direction: Array) -> Array:
    """Return right-handed axes as columns with e3 along each vector (P, 3), (P, 3, 3)."""
    e3 = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
    seed = np.eye(3)[np.abs(e3).argmin(axis=-1)]
    e1 = seed - np.sum(seed * e3, axis=-1, keepdims=True) * e3
    e1 /= np.linalg.norm(e1, axis=-1, keepdims=True)
    return np.stack([e1, so3.cross(e3, e1), e3], axis=-1)


def _frames(axes: Array, direction: Array) -> Array:
    """Return the axes (P, 3, 3), turned by the smallest rotation that takes e3 to each direction (P, 3)."""
    turn = so3.smallest_rotation(axes[..., 2], direction)
    return np.asarray(so3.axes(turn) @ axes)


def _flat(numbers: ComplexArray) -> Array:
    return np.stack([numbers.real, numbers.imag, np.zeros(numbers.shape)], axis=-1)
