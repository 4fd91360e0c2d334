"""Differences between a plan and a file made of it, over continuous time: the loss of an export.

Between its rows, a file is read as its format requires: along straight lines, with attitudes by the shortest
turn at a constant rate, or, for a stream of set-points, by holding the last row. Differences of positions and
of velocities are then piecewise polynomials, whose peaks are exact. Attitudes are compared at many instants.
Between two of these, their difference is bounded by the angle that they turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees, factorial

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.flatness import Reference, reference
from aerobat.planning import Plan
from aerobat.simulation.outcome import length
from aerobat.trajectory import Trajectory
from aerobat.trajectory.piecewise import TIME_TOLERANCE

PARTS = 16  # of the time between two rows; attitudes are compared at their ends, with some percent of error
ROWS_AT_ONCE = 2000  # rows that are compared together, in some tens of megabytes
STRAIGHT = "straight lines between rows"
HELD = "each row held until the next"


@dataclass(frozen=True)
class Loss:
    """The largest differences, over continuous time, between a plan and a file as its readers take it."""

    position: float  # [m]
    velocity: float  # [m/s]
    attitude: float  # [rad] between attitudes, with the heading
    thrust_axis: float  # [rad] between thrust axes, without the heading
    reading: str  # the way to read the file between its rows
    obstacles: float = 0.0  # [m] by which triangles of round obstacles lie inside of them
    without: str = ""  # content for which the format has no place, in words

    def __str__(self) -> str:
        """Return one line of text."""
        flat = f"; round obstacles drawn up to {length(self.obstacles)} inside" if self.obstacles else ""
        lacks = f"; the file has no place for {self.without}" if self.without else ""
        return (
            f"lost at most {length(self.position)} of position, {self.velocity:.2g} m/s of velocity, "
            f"{_degrees(self.attitude)} of attitude and {_degrees(self.thrust_axis)} of the thrust's "
            f"direction ({self.reading}){flat}{lacks}"
        )

    def record(self) -> dict[str, object]:
        """Return plain data, with units in the keys."""
        return {
            "position_m": self.position,
            "velocity_m_s": self.velocity,
            "attitude_deg": degrees(self.attitude),
            "thrust_axis_deg": degrees(self.thrust_axis),
            "reading": self.reading,
            "obstacles_m": self.obstacles,
            "without": self.without,
        }


@dataclass(frozen=True)
class Content:
    """Files made of a plan, in the order of the format's names, before they are written, and their loss."""

    files: tuple[bytes, ...]
    loss: Loss


@dataclass(frozen=True, eq=False)
class ExportRows:
    """Rows of a file, as rounded there, in our axes."""

    times: Array  # [s] rising, (T,)
    position: Array  # [m] world, (T, 3)
    velocity: Array | None  # [m/s] world, (T, 3); None where readers differentiate the position
    q_world_body: Array  # (T, 4)

    @classmethod
    def of(cls, found: Reference) -> ExportRows:
        """Return rows with the exact numbers of a reference."""
        flat = found.setpoint.flat
        return cls(found.times, flat.position, flat.velocity, found.setpoint.q_world_body)

    def loss(self, plan: Plan, held: bool = False) -> Loss:
        """Return the loss of these rows, if they are read along straight lines, or `held`."""
        position = self._curve(self.position, held)
        velocity = position if self.velocity is None else self._curve(self.velocity, held)
        attitude, thrust_axis = self._angles(plan, held)
        return Loss(
            position=peak_difference(plan.trajectory, 0, position),
            velocity=peak_difference(plan.trajectory, 1, velocity, 1 if self.velocity is None else 0),
            attitude=attitude,
            thrust_axis=thrust_axis,
            reading=HELD if held else STRAIGHT,
        )

    def _curve(self, rows: Array, held: bool) -> Trajectory:
        """Return rows (T, 3) as they are read, from the first to the last."""
        powers = rows[:-1, None] if held else np.stack([rows[:-1], np.diff(rows, axis=0)], axis=1)
        return Trajectory(np.diff(self.times), powers)

    def _angles(self, plan: Plan, held: bool) -> tuple[float, float]:
        """Return the largest angles between attitudes and between thrust axes [rad]."""
        starts = range(0, len(self.times) - 1, ROWS_AT_ONCE)
        parts = [self._angles_of(slice(start, start + ROWS_AT_ONCE + 1), plan, held) for start in starts]
        return max(attitude for attitude, _ in parts), max(axis for _, axis in parts)

    def _angles_of(self, rows: slice, plan: Plan, held: bool) -> tuple[float, float]:
        times, q = self.times[rows], self.q_world_body[rows]
        s = np.linspace(0.0, 1.0, PARTS + 1)
        instants = times[:-1, None] + s * np.diff(times)[:, None]
        planned = attitudes(plan, instants.ravel()).reshape(*instants.shape, 4)
        first = q[:-1, None]
        turn = so3.box_minus(q[1:], q[:-1])
        read = first if held else so3.multiply(first, so3.exp(s[:, None] * turn[:, None]))
        return peak_angles(planned, np.broadcast_to(read, planned.shape))


def _degrees(angle: float) -> str:
    """Return an angle [rad] in degrees, small angles with two digits."""
    value = degrees(angle)
    return f"{value:.2g}°" if value < 10.0 else f"{value:.0f}°"


def attitudes(plan: Plan, times: Array) -> Array:
    """Return a plan's attitudes, body to world, (T, 4), at times [s], (T,), that may fall by rounding."""
    rising = np.minimum(np.maximum.accumulate(times), plan.duration)
    return reference(plan, times=rising).setpoint.q_world_body


def peak_difference(path: Trajectory, derivative: int, read: Trajectory, read_derivative: int = 0) -> float:
    """Return the exact largest distance between derivatives of two paths, over the time that both last.

    Args:
        path: One path.
        derivative: The order of its derivative.
        read: The other path.
        read_derivative: The order of its derivative.
    """
    end = min(path.duration, read.duration)
    cuts = np.unique(np.concatenate([path.knots, read.knots]))
    cuts = np.concatenate([[0.0], cuts[(cuts > TIME_TOLERANCE) & (cuts < end - TIME_TOLERANCE)], [end]])
    cuts = cuts[np.append(np.diff(cuts) > TIME_TOLERANCE, True)]  # of two equal ones the later, see knots
    size = 1 + max(path.degree - derivative, read.degree - read_derivative, 0)
    apart = _expanded(path, derivative, cuts, size) - _expanded(read, read_derivative, cuts, size)
    return Trajectory(np.diff(cuts), apart).peak(0).value


def peak_angles(attitude: Array, other: Array) -> tuple[float, float]:
    """Return bounds on the angles [rad] between attitudes, and between their thrust axes.

    Args:
        attitude: Samples along intervals, (intervals, samples, 4).
        other: Other attitudes at the same instants.
    """
    apart = so3.multiply(so3.conjugate(attitude), other)
    axes = so3.thrust_axis(apart)
    upright = np.broadcast_to([1.0, 0.0, 0.0, 0.0], apart.shape)
    tilt = so3.smallest_rotation(np.broadcast_to(so3.UP, axes.shape), axes)
    return (
        _peak(so3.angle_between(upright, apart), so3.angle_between(apart[:, :-1], apart[:, 1:])),
        _peak(so3.angle_between(upright, tilt), np.linalg.norm(np.diff(axes, axis=1), axis=-1)),
    )


def _peak(angles: Array, turned: Array) -> float:
    """Return a bound on angles by samples (n, m), and by the turns from each to the next (n, m - 1)."""
    between = (angles[:, :-1] + angles[:, 1:] + turned) / 2.0  # an angle changes by the turn at most,
    rise = np.abs(np.diff(angles, 2, axis=1)) / 8.0  # and between samples has the peak of a parabola
    rise = np.pad(rise, ((0, 0), (1, 1)), mode="edge")  # (n, m)
    between += np.maximum(rise[:, :-1], rise[:, 1:])
    return float(min(between.max(), np.pi))


def _expanded(path: Trajectory, derivative: int, cuts: Array, size: int) -> Array:
    """Return d^k p/dt^k in powers of normalised time from each cut to the next, (cuts - 1, size, 3)."""
    steps = np.diff(cuts)[:, None]
    powers = np.zeros((len(steps), size, 3))
    for power in range(min(path.degree - derivative + 1, size)):
        powers[:, power] = path.evaluate(cuts[:-1], derivative + power) * steps**power / factorial(power)
    return powers
