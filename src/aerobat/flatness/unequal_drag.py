"""The attitude of a vehicle whose drag differs between body x and body y.

Its thrust axis differs from that of the mean drag by an amount that depends on the body's angle ψ about it.
The angle is measured from the frame that `parallel_transport` carries along the mean-drag thrust. The rate ψ'
follows from ω_z = 0 (`kernels.unequal_drag`) and is integrated by Picard iteration on Chebyshev series.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array, xyz
from aerobat.environment import Environment
from aerobat.kernels import unequal_drag as kernel
from aerobat.kernels.ops import Axes, Vector
from aerobat.kernels.vectors import add_scaled
from aerobat.so3 import UP
from aerobat.states import FlatState
from aerobat.trajectory import Trajectory, polynomial
from aerobat.trajectory.subintervals import Subintervals
from aerobat.vehicle.vehicle import Vehicle

NODES = 20  # Chebyshev nodes of a piece
# largest last terms, relative to the first, of functions that are singular where no attitude is determined
MAX_LAST_TERM = 1e-10
MIN_PIECE_LENGTH = 2.0**-12  # smallest piece, as a fraction of a segment
MAX_ITERATIONS = 100  # limit of Picard iterations; the errors fall as the terms of the exponential series
ANGLE_TOLERANCE = 1e-14  # [rad] change at which the iteration has converged
MAX_RELATIVE_SIZE = 0.5  # largest contribution of the drag difference, as a fraction of the mean-drag thrust


@dataclass(frozen=True)
class UnequalDrag:
    """Drag coefficients divided by the mass, and the environment."""

    coefficients: Array  # [1/s] along body x, y and z, (3,)
    wind: Array  # [m/s]
    weight: Array  # [m/s²]

    @classmethod
    def of(cls, vehicle: Vehicle, environment: Environment) -> UnequalDrag:
        """Return the drag of a vehicle in an environment."""
        return cls(vehicle.drag_body / vehicle.mass, environment.wind, environment.weight)

    @property
    def mean(self) -> float:
        """The mean of the drag coefficients along body x and y [1/s]."""
        return float(self.coefficients[:2].mean())

    @property
    def difference(self) -> float:
        """The excess of the drag coefficient along body x over the mean [1/s]."""
        return float(self.coefficients[0] - self.coefficients[1]) / 2

    def relative_size(self, thrust: Array, airspeed: Array) -> Array:
        """Return the largest contribution of unequal drag, as a fraction (...) of mean-drag thrusts."""
        size = np.maximum(np.linalg.norm(thrust, axis=-1), np.finfo(float).tiny)
        return np.asarray(abs(self.difference) * np.linalg.norm(airspeed, axis=-1) / size)

    def saturated_difference(self, thrust: Array, airspeed: Array) -> Array:
        """Return `difference`, reduced where its relative size exceeds MAX_RELATIVE_SIZE, (...)."""
        size = self.relative_size(thrust, airspeed)
        return np.asarray(self.difference * MAX_RELATIVE_SIZE / np.maximum(size, MAX_RELATIVE_SIZE))


def resolved_pieces(trajectory: Trajectory, drag: UnequalDrag) -> Subintervals:
    """Halve segments until series of NODES terms resolve the attitude; return the pieces in order."""
    pending, done = Subintervals.whole(trajectory.segments), []
    while len(pending):
        motion = motion_on(trajectory, pending, nodes(), 2)
        airspeed, thrust = motion[:, :, 0] - drag.wind, motion[:, :, 1] + drag.weight
        singular = [1 / np.sum((thrust + c * airspeed) ** 2, axis=-1) for c in drag.coefficients[:2]]
        series = np.abs(np.stack(singular, axis=1) @ analysis().T)
        rough = (series[..., -2:].max(axis=(1, 2)) > MAX_LAST_TERM * series[..., 0].max(axis=1)) & (
            pending.length > MIN_PIECE_LENGTH
        )
        done.append(pending[~rough])
        pending = pending[rough].halves()
    return Subintervals.joined(done).in_order()


def trajectory_through(times: Array, flat: FlatState, heading: float) -> Trajectory:
    """Return a trajectory from the origin through velocity to snap of a series at its times (T,)."""
    moves = np.diff(times) > 0.0
    durations = np.diff(times)[moves]
    rates = np.stack([flat.velocity, flat.acceleration, flat.jerk, flat.snap], axis=1)
    scale = durations[:, None, None] ** np.arange(4)[:, None]
    velocity = polynomial.hermite(scale * rates[:-1][moves], scale * rates[1:][moves])
    position = durations[:, None, None] * velocity / np.arange(1, 9)[:, None]
    return Trajectory(durations, np.concatenate([0.0 * position[:, :1], position], axis=1), heading)


@dataclass(frozen=True)
class FrameAngle:
    """The angle ψ [rad] from the frame of the mean drag to the one nearest to the body's axes."""

    starts: Array  # [s] of the pieces, (P,)
    seconds: Array  # [s] durations of the pieces, (P,)
    series: Array  # Chebyshev series of ψ on the pieces, (P, NODES + 1)

    @classmethod
    def along(
        cls, trajectory: Trajectory, drag: UnequalDrag, pieces: Subintervals, q_mean: Array
    ) -> FrameAngle:
        """Integrate ψ' along pieces.

        Args:
            trajectory: The path.
            drag: The drag of the vehicle.
            pieces: Consecutive pieces of the trajectory.
            q_mean: The frame of the mean drag at the nodes of the pieces, (P, NODES, 4).
        """
        velocity, acceleration, jerk = np.moveaxis(motion_on(trajectory, pieces, nodes(), 3), 2, 0)
        local = _Local.of(drag, velocity - drag.wind, acceleration, jerk, q_mean)
        seconds = pieces.seconds(trajectory)
        yaw = trajectory.yaw_polynomials(1)[pieces.interval, None]
        yaw_rate = polynomial.evaluate(yaw, pieces.positions(nodes()))[..., 0]
        angle = np.zeros(local.norm.shape)
        for _ in range(MAX_ITERATIONS):
            rate = local.spin(angle, yaw_rate)
            series = chebyshev.chebint(rate @ analysis().T, lbnd=-1, axis=1) * seconds[:, None] / 2
            series[1:, 0] += np.cumsum(series.sum(axis=1))[:-1]
            series[:, 0] += trajectory.yaw_polynomials(0)[0, 0, 0]
            last, angle = angle, series @ chebyshev.chebvander(nodes(), NODES).T
            if np.abs(angle - last).max() <= ANGLE_TOLERANCE * max(1.0, np.abs(angle).max()):
                break
        starts, _ = pieces.spans(trajectory)
        return cls(starts, seconds, series)

    def at(self, times: Array) -> Array:
        """Return ψ at times [s], (T,)."""
        piece = np.maximum(np.searchsorted(self.starts, times, side="right") - 1, 0)
        position = 2 * (times - self.starts[piece]) / self.seconds[piece] - 1
        return np.asarray(chebyshev.chebval(position, self.series[piece].T, tensor=False))


def body_attitudes(q_mean: Array, angle: Array, flat: FlatState, drag: UnequalDrag, balance: Array) -> Array:
    """Return the attitudes (..., 4) of the body.

    Args:
        q_mean: The frame of the mean drag, (..., 4).
        angle: The angle ψ [rad], (...).
        flat: Flat states, (...).
        drag: The drag of the vehicle.
        balance: Mean-drag specific thrust, world [m/s²], (..., 3).
    """
    near = so3.multiply(q_mean, so3.about_axis(UP, angle))
    airspeed = flat.velocity - drag.wind
    kappa = drag.saturated_difference(balance, airspeed)
    thrust, air = (xyz(so3.unrotate(near, vector)) for vector in (balance, airspeed))
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = kernel.nearest_axes(
        np.sqrt, add_scaled(thrust, kappa, air), add_scaled(thrust, -kappa, air)
    )
    # the body's axes are within a right angle of these, so the quaternion's first component is large
    q = np.stack([1 + xx + yy + zz, yz - zy, zx - xz, xy - yx], axis=-1)
    return so3.multiply(near, so3.normalize(q))


def body_motion(
    q: Array, flat: FlatState, drag: UnequalDrag, balance: Array, yaw: Array | None
) -> tuple[Array, Array, Array]:
    """Return body rates [rad/s] and accelerations [rad/s²], body axes, and specific collective thrust [m/s²].

    Args:
        q: Attitudes of the body, (..., 4).
        flat: Flat states, (...).
        drag: The drag of the vehicle.
        balance: Mean-drag specific thrust, world [m/s²], (..., 3).
        yaw: Yaw rate about the thrust axis [rad/s] and its derivative, (2, ...), or None.
    """
    airspeed = flat.velocity - drag.wind
    kappa = drag.saturated_difference(balance, airspeed)
    mean = drag.mean
    world = (airspeed, flat.acceleration, flat.jerk, flat.acceleration + drag.weight, flat.snap)
    air, accelerated, jerk, thrust, snap = (xyz(so3.unrotate(q, vector)) for vector in world)
    motion = ((thrust, air), (jerk, accelerated), (snap, jerk))
    alpha = [add_scaled(x, mean + kappa, below) for x, below in motion]
    beta = [add_scaled(x, mean - kappa, below) for x, below in motion]
    rates = kernel.body_rates(
        (1.0 / alpha[0][2], 1.0 / beta[0][2]), alpha, beta, None if yaw is None else tuple(yaw)
    )
    omega, omega_dot = (np.stack([x, y, z + np.zeros_like(x)], axis=-1) for x, y, z in rates)
    return omega, omega_dot, thrust[2] + drag.coefficients[2] * air[2]


@dataclass(frozen=True)
class _Local:
    """A motion in the frame of the mean drag, z along its thrust; x + i y across it. All (P, N)."""

    difference: Array
    norm: Array  # norm of the thrust
    rising: Array  # component of the thrust's derivative along the thrust
    turning: NDArray[np.complex128]  # component of the thrust's derivative across the thrust
    air: NDArray[np.complex128]
    air_along: Array
    accelerated: NDArray[np.complex128]
    accelerated_along: Array

    @classmethod
    def of(
        cls, drag: UnequalDrag, airspeed: Array, acceleration: Array, jerk: Array, q_mean: Array
    ) -> _Local:
        mean = drag.mean
        thrust = acceleration + drag.weight + mean * airspeed
        vectors = (jerk + mean * acceleration, airspeed, acceleration)
        parts = []
        for x, y, z in (xyz(so3.unrotate(q_mean, vector)) for vector in vectors):
            parts += [x + 1j * y, z]
        across, rising, air, air_along, accelerated, accelerated_along = parts
        norm = np.maximum(np.linalg.norm(thrust, axis=-1), np.finfo(float).tiny)
        kappa = drag.saturated_difference(thrust, airspeed)
        return cls(kappa, norm, rising, across, air, air_along, accelerated, accelerated_along)

    def spin(self, angle: Array, yaw_rate: Array) -> Array:
        """Return ψ' [rad/s] at angles ψ, for a body that yaws about its thrust axis at `yaw_rate` [rad/s]."""
        back = np.exp(-1j * angle)
        change, air, accelerated = (
            _vector(back * across, along)
            for across, along in (
                (self.turning, self.rising),
                (self.air, self.air_along),
                (self.accelerated, self.accelerated_along),
            )
        )
        thrust = (0.0, 0.0, self.norm)
        alpha, beta = (add_scaled(thrust, sign * self.difference, air) for sign in (1.0, -1.0))
        body: Axes = kernel.nearest_axes(np.sqrt, alpha, beta)
        rising = add_scaled(change, self.difference, accelerated)
        return np.asarray(kernel.frame_spin((self.norm, change), (alpha, rising), body, yaw_rate))


def motion_on(trajectory: Trajectory, pieces: Subintervals, at: Array, orders: int) -> Array:
    """Return `orders` derivatives, from velocity on, at positions in [-1, 1] on pieces, (P, N, orders, 3)."""
    s, found = pieces.positions(at), []
    for k in range(1, orders + 1):
        rates = polynomial.differentiate(trajectory.coefficients, k)[pieces.interval, None]
        values = polynomial.evaluate(rates, s)
        found.append(values / trajectory.durations[pieces.interval, None, None] ** k)
    return np.stack(found, axis=2)


@cache
def nodes(count: int = NODES) -> Array:
    """Return Chebyshev points inside a piece, which exclude knots, (count,)."""
    return np.asarray(chebyshev.chebpts1(count))


@cache
def analysis(count: int = NODES) -> Array:
    """Return the matrix from values at the nodes to Chebyshev coefficients, (count, count)."""
    return np.asarray(np.linalg.inv(chebyshev.chebvander(nodes(count), count - 1)))


def _vector(across: NDArray[np.complex128], along: Array) -> Vector:
    return across.real, across.imag, along
