"""Body rates along pieces, in a frame that is carried along the thrust direction without spin.

On a piece take any fixed axes e1, e2, e3 with e3 near the thrust, and let f = (u, v, w) in them, n = |f|,
b3 = f/n. The smallest rotation from e3 to b3 makes of e1, e2

    x~ = e1 − u g,   y~ = e2 − v g,   g = (e3 + b3)/(n + w)

and the frame without spin lies at an angle φ from them about b3, with φ' = (u v' − v u') / (n (n + w))
(Hanson and Ma, 1995). Rates, as complex numbers x + i y in the plane across b3, are then

    b3'  = (f'  − (u + i v) g·f') / n
    b3'' = (f'' − (u + i v) g·f'' − 2 n' b3') / n

times exp(−i φ), and ω = i b3', ω' = i b3''. Nothing here divides by 1 + b3_z.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array
from aerobat.certification.enclosure import chebyshev

UP = np.array([0.0, 0.0, 1.0])
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class ThrustDirectionRates:
    """How the thrust direction turns along P pieces, at N nodes each, in a frame of its own on each piece."""

    axes: Array  # e1, e2, e3 as columns, (P, 3, 3)
    direction: Array  # b3, world, (P, N, 3)
    rate: ComplexArray  # b3' across b3 [rad/s], (P, N)
    acceleration: ComplexArray  # b3'' across b3 [rad/s²], (P, N)
    twist: Array  # φ since the piece's start [rad], (P, N)

    @classmethod
    def along(
        cls, values: Array, mean: Array, seconds: Array, basis: chebyshev.Basis
    ) -> ThrustDirectionRates:
        """The turning of f, f', f'' (P, N, 3, 3) at the basis's nodes; e3 along the `mean` of f (P, 3)."""
        axes = _axes_about(mean)
        local = values @ axes[:, None]
        u, v, w = np.moveaxis(local[..., 0, :], -1, 0)
        n = np.sqrt(u * u + v * v + w * w)
        stretch = np.sum(local * local[..., :1, :], axis=-1) / n[..., None]  # b3·f, b3·f', b3·f''
        along = (local[..., 2] + stretch) / (n + w)[..., None]  # g·f, g·f', g·f''
        across = local[..., 0] + 1j * local[..., 1]
        carried = across - across[..., :1] * along
        rate = carried[..., 1] / n
        acceleration = (carried[..., 2] - 2 * stretch[..., 1] * rate) / n
        spin = np.imag(np.conj(across[..., 0]) * across[..., 1]) / (n * (n + w))
        twist = seconds[:, None] / 2 * chebyshev.integral(spin, basis)
        return cls(axes, values[..., 0, :] / n[..., None], rate, acceleration, twist)

    def carried(self, heading: float) -> Array:
        """φ at all nodes (P, N) of a frame that each piece takes over from the one before it.

        It starts as the smallest rotation from the vertical to b3, turned by `heading`; where directions of
        neighbours differ it takes the smallest rotation.
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
        """ω and ω' in the axes of a body whose frame is at these angles φ (P, N), each (P, N, 3)."""
        back = 1j * np.exp(-1j * angle)
        omega, omega_dot = (_flat(back * rate) for rate in (self.rate, self.acceleration))
        return omega, omega_dot


def _axes_about(direction: Array) -> Array:
    """Right-handed axes as columns with e3 along each vector (P, 3), (P, 3, 3)."""
    e3 = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
    seed = np.eye(3)[np.abs(e3).argmin(axis=-1)]
    e1 = seed - np.sum(seed * e3, axis=-1, keepdims=True) * e3
    e1 /= np.linalg.norm(e1, axis=-1, keepdims=True)
    return np.stack([e1, so3.cross(e3, e1), e3], axis=-1)


def _frames(axes: Array, direction: Array) -> Array:
    """The axes (P, 3, 3), turned by the smallest rotation that takes e3 to each direction (P, 3)."""
    turn = so3.smallest_rotation(axes[..., 2], direction)
    return np.asarray(so3.axes(turn) @ axes)


def _flat(numbers: ComplexArray) -> Array:
    return np.stack([numbers.real, numbers.imag, np.zeros(numbers.shape)], axis=-1)
