"""Whether rotors can fly a trajectory: their thrusts by flatness, along all of it, against their limits.

Thrusts are taken at nodes that follow the thrust direction's turning, both sides of every knot among them;
each local extreme that might be the answer is then found between its neighbours by interpolation at
Chebyshev points, and evaluated there, so that nothing rests on the sampling alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.certification.continuity import discontinuities
from aerobat.certification.thrust_curve import ThrustCurve
from aerobat.environment import Environment
from aerobat.flatness.parallel_transport import Frames, TimeInterval, advance, frames
from aerobat.flatness.references import UNDETERMINED, body_rates, specific_thrust, wrench_for
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle, rotor_thrusts

PIECES_PER_DEGREE = 4  # nodes put on each segment beforehand, per degree of its polynomial
CANDIDATES = 24  # local extremes looked into
ROUNDING = 1e-12  # relative differences of thrust that mean nothing


@dataclass(frozen=True)
class RotorMargin:
    """How far the rotors stay from their limits along a trajectory, by flatness.

    `min_thrust` is the least thrust of the rotor that comes closest to its lower limit, `max_thrust` the
    largest of the one that comes closest to its upper limit: with equal rotors, of all of them.
    """

    min_thrust: float  # [N]
    min_time: float  # [s]
    min_rotor: int
    max_thrust: float  # [N]
    max_time: float  # [s]
    max_rotor: int
    low_margin: float  # [N] from the lower limit, negative: below it
    high_margin: float  # [N] from the upper limit, negative: above it
    undetermined: tuple[TimeInterval, ...]  # where thrust vanishes, and with it the attitude
    bounded_moments: bool  # False if attitude or body rates jump, which no moment can do

    @property
    def margin(self) -> float:
        """The distance to the nearest limit [N], negative: beyond it by so much."""
        return min(self.low_margin, self.high_margin)

    @property
    def feasible(self) -> bool:
        """Whether every rotor stays within its limits within all segments, the attitude always determined.

        Jumps of body rates between segments, which integrator order 3 has everywhere, are not held against
        it: look at `bounded_moments`.
        """
        return self.margin >= 0 and not self.undetermined

    def __str__(self) -> str:
        """The outcome in a few words."""
        words = f"{self.min_thrust:.2f} to {self.max_thrust:.2f} N, "
        if self.margin >= 0:
            words += f"within limits by {self.margin:.2f} N"
        elif self.low_margin < self.high_margin:
            words += f"{-self.margin:.2f} N too little for rotor {self.min_rotor} at {self.min_time:.3f} s"
        else:
            words += f"{-self.margin:.2f} N too much for rotor {self.max_rotor} at {self.max_time:.3f} s"
        if self.undetermined:
            words += f"; thrust vanishes at {self.undetermined[0].start:.3f} s, so no attitude is determined"
        if not self.bounded_moments:
            words += "; body rates jump between segments, where moments are unbounded"
        return words


def rotor_margin(
    trajectory: Trajectory, vehicle: Vehicle, environment: Environment | None = None
) -> RotorMargin:
    """The rotors' margin along the whole trajectory."""
    environment = environment or Environment()
    path = _Path.along(trajectory, vehicle, environment)
    low, high = path.least_gaps()
    return RotorMargin(
        min_thrust=float(vehicle.min_thrusts[low.rotor]) + low.value,
        min_time=low.time,
        min_rotor=low.rotor,
        max_thrust=float(vehicle.max_thrusts[high.rotor]) - high.value,
        max_time=high.time,
        max_rotor=high.rotor,
        low_margin=low.value,
        high_margin=high.value,
        undetermined=path.frames.undetermined,
        bounded_moments=_bounded_moments(trajectory, vehicle, environment),
    )


@dataclass(frozen=True)
class _Gap:
    """A distance of one rotor's thrust from one of its limits."""

    value: float  # [N], negative: beyond the limit
    rotor: int
    time: float  # [s]


@dataclass(frozen=True)
class _Candidates:
    """Local minima of gaps among nodes: (c,) nodes, and (c,) columns of the gaps."""

    nodes: NDArray[np.intp]
    columns: NDArray[np.intp]


@dataclass(frozen=True)
class _Path:
    """A trajectory's frames at nodes, and what the rotors do there and between them."""

    trajectory: Trajectory
    vehicle: Vehicle
    environment: Environment
    frames: Frames
    segment: NDArray[np.intp]  # of every node, (M,)

    @classmethod
    def along(cls, trajectory: Trajectory, vehicle: Vehicle, environment: Environment) -> _Path:
        count = PIECES_PER_DEGREE * max(trajectory.degree, 1) + 1
        s = np.linspace(0.0, 1.0, count)
        v, a, j, snap = (trajectory.on_segments(s, k).reshape(-1, 3) for k in (1, 2, 3, 4))
        times = trajectory.knots[:-1, None] + s * trajectory.durations[:, None]
        floor = UNDETERMINED * environment.gravity
        thrust = specific_thrust(vehicle, environment, v - environment.wind, a, j, snap)
        path = frames(times.ravel(), thrust, floor, trajectory.heading)
        starts = path.samples[::count]
        return cls(
            trajectory,
            vehicle,
            environment,
            path,
            np.searchsorted(starts, np.arange(len(path.times)), "right") - 1,
        )

    def least_gaps(self) -> tuple[_Gap, ...]:
        """The least distances to lower and to upper limits over rotors and continuous time."""
        path = self.frames
        airspeed = self.trajectory.evaluate(path.times, 1) - self.environment.wind
        sampled = self._gaps(path.thrust, airspeed, path.q_world_body, path.determined)
        found = self._candidates(sampled)
        times = self._vertices(found)
        refined = self._between(found, times[:, None])[:, 0]
        # what may be least: the least node of every rotor, and every candidate refined
        count = sampled.shape[1]
        nodes = sampled.argmin(axis=0)
        values = np.concatenate([sampled[nodes, np.arange(count)], refined])
        columns = np.concatenate([np.arange(count), found.columns])
        at = np.concatenate([self.frames.times[nodes], times])
        upper, rotors = np.divmod(columns, count // 2)
        low, high = (int(np.where(upper == side, values, np.inf).argmin()) for side in (0, 1))
        return tuple(_Gap(float(values[i]), int(rotors[i]), float(at[i])) for i in (low, high))

    def _candidates(self, gaps: Array) -> _Candidates:
        """Local minima of the gaps at the nodes (M, 2n) beside which the least may hide.

        A smooth curve falls between nodes by less than it rises to the next ones.
        """
        within = self.segment[1:] == self.segment[:-1]
        rises = np.where(within[:, None], gaps[1:] - gaps[:-1], np.nan)
        edge = np.full((1, gaps.shape[1]), np.nan)
        before, after = np.concatenate([edge, -rises]), np.concatenate([rises, edge])
        spread = np.fmax(before, after)
        hidden = gaps - spread
        usable = ~((before < 0) | (after < 0)) & (spread > ROUNDING * np.abs(gaps).max())
        least = np.repeat(gaps.min(axis=0).reshape(2, -1).min(axis=1), gaps.shape[1] // 2)
        nodes, columns = np.nonzero(usable & self._determined_around()[:, None] & (hidden < least))
        order = np.argsort(hidden[nodes, columns] - least[columns])[:CANDIDATES]
        return _Candidates(nodes[order], columns[order])

    def _determined_around(self) -> NDArray[np.bool_]:
        """Whether the attitude is determined at each node and both its neighbours, (M,)."""
        padded = np.concatenate([[True], self.frames.determined, [True]])
        return np.asarray(padded[:-2] & padded[1:-1] & padded[2:])

    def _vertices(self, found: _Candidates) -> Array:
        """The times (c,) at which the gaps are least between the candidates' neighbours."""
        times, nodes = self.frames.times, found.nodes
        before, after = np.maximum(nodes - 1, 0), np.minimum(nodes + 1, len(times) - 1)
        start = times[np.where(self.segment[before] == self.segment[nodes], before, nodes)]
        end = times[np.where(self.segment[after] == self.segment[nodes], after, nodes)]
        middle, half = (start + end) / 2, (end - start) / 2
        gaps = self._between(found, middle[:, None] + half[:, None] * CHEBYSHEV)
        return np.asarray(middle + half * _least_at(gaps @ TO_DENSE.T))

    def _between(self, found: _Candidates, times: Array) -> Array:
        """The candidates' gaps [N] at times (c, k) between their neighbours, (c, k)."""
        base = (found.nodes[:, None] - (times < self.frames.times[found.nodes, None])).ravel()
        at = times.ravel()
        v, a, j, s = (self.trajectory.evaluate(at, k) for k in (1, 2, 3, 4))
        airspeed = v - self.environment.wind
        thrust = specific_thrust(self.vehicle, self.environment, airspeed, a, j, s)
        step = at - self.frames.times[base]
        q = advance(self.frames.q_world_body[base], self.frames.thrust[base], thrust, step)
        gaps = self._gaps(thrust, airspeed, q, np.ones(len(at), dtype=bool))
        gaps = gaps.reshape(*times.shape, 2 * len(self.vehicle.rotors))
        return np.take_along_axis(gaps, found.columns[:, None, None], axis=-1)[..., 0]

    def _gaps(self, thrust: Array, airspeed: Array, q: Array, determined: NDArray[np.bool_]) -> Array:
        """Distances of all rotors' thrusts from their lower, then from their upper limits [N], (..., 2n)."""
        omega, omega_dot = body_rates(thrust, q, determined)
        rotors = rotor_thrusts(self.vehicle, wrench_for(thrust, airspeed, omega, omega_dot, self.vehicle))
        return np.concatenate([rotors - self.vehicle.min_thrusts, self.vehicle.max_thrusts - rotors], axis=-1)


def _least_at(dense: Array) -> Array:
    """Where in [-1, 1] curves given on DENSE points (c, m) are least: a parabola's vertex, (c,)."""
    k = np.clip(dense.argmin(axis=1), 1, dense.shape[1] - 2)
    left, at, right = (np.take_along_axis(dense, (k + i)[:, None], axis=1)[:, 0] for i in (-1, 0, 1))
    curvature = left - 2 * at + right
    shift = np.divide(left - right, 2 * curvature, out=np.zeros_like(at), where=curvature > 0)
    return np.asarray(DENSE[k] + np.clip(shift, -1.0, 1.0) * (DENSE[1] - DENSE[0]))


def _bounded_moments(trajectory: Trajectory, vehicle: Vehicle, environment: Environment) -> bool:
    """Whether attitude and body rates are continuous across knots, where the attitude is determined.

    Jerk may jump along the thrust axis: that is a kink in the thrust's size.
    """
    curve = ThrustCurve.of(trajectory, vehicle, environment, trajectory.degree)
    return not discontinuities(curve, UNDETERMINED * environment.gravity)


CHEBYSHEV = np.polynomial.chebyshev.chebpts1(9)
DENSE = np.linspace(-1.0, 1.0, 129)
TO_DENSE = np.polynomial.chebyshev.chebvander(DENSE, 8) @ np.linalg.inv(
    np.polynomial.chebyshev.chebvander(CHEBYSHEV, 8)
)
