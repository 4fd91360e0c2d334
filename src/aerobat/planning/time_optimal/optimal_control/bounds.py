"""Bounds along the whole motion, and how much more than them is kept at nodes, interval by interval."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf

import numpy as np

from aerobat.arrays import Array
from aerobat.flatness import force_balance, reference
from aerobat.planning.time_optimal.optimal_control.collocation import BOUNDED_DERIVATIVES
from aerobat.problem.condition import LinearBound
from aerobat.problem.problem import Problem
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

# of each interval: where it is looked at, evenly spaced angles of Chebyshev's, at either end just within it
ANGLES = np.linspace(1e-4, np.pi - 1e-4, 24)
LOOKS = (1.0 - np.cos(ANGLES)) / 2.0
SERIES = np.cos(np.outer(ANGLES, np.arange(len(ANGLES))))  # Chebyshev's polynomials of cos θ = 1 − 2 s there
# d/ds at the looks of what is known there, by the polynomial through it: d/ds T_n(1 − 2 s) = −2 n U_{n−1}
DIFFERENTIATION = (
    -2.0
    * np.arange(len(ANGLES))
    * np.sin(np.outer(ANGLES, np.arange(len(ANGLES))))
    / np.sin(ANGLES)[:, None]
    @ np.linalg.inv(SERIES)
)
BACKOFF = 1e-4  # of a bound's size: how much more is kept, each time, than what is exceeded
NEAR = 1e-4  # of a bound's size: what comes so near may exceed it between two looks
OVERSHOOT = 1.5  # times what is exceeded: a larger backoff moves what is between nodes too
MAX_BACKOFF = 0.9  # of a range, from both ends together: more leaves nothing


@dataclass(frozen=True, eq=False)
class PathBound:
    """lower ≤ Σ weights[k] · p⁽ᵏ⁾ ≤ upper all along, SI units, world frame."""

    weights: Array  # (5, 3), a row for position and each derivative up to snap
    lower: float
    upper: float
    size: float  # of what is bounded

    @classmethod
    def of(cls, bound: LinearBound) -> PathBound:
        """A condition's."""
        weights = np.vstack([bound.weights, np.zeros((BOUNDED_DERIVATIVES - len(bound.weights), 3))])
        return cls(weights, *bound.limits, bound.scale)

    @property
    def order(self) -> int:
        """The highest derivative that counts."""
        return int(np.flatnonzero(self.weights.any(axis=1)).max())


@dataclass(frozen=True, eq=False)
class Bounds:
    """Bounds of path, rotors and body rate, M quantities in this order."""

    vehicle: Vehicle
    problem: Problem
    path: tuple[PathBound, ...]

    @classmethod
    def of(cls, problem: Problem, vehicle: Vehicle) -> Bounds:
        """A vehicle's, those of a problem's limits and of what its maneuver asks throughout, drag counted."""
        balance = force_balance(problem.environment, vehicle)
        constraints = problem.stages(vehicle.max_specific_thrust).path_constraints
        path = [PathBound.of(condition.bound(balance)) for condition in constraints]
        for derivative in range(BOUNDED_DERIVATIVES):
            for axis, (lower, upper) in enumerate(zip(*problem.path_limits.of(derivative), strict=True)):
                if np.isfinite([lower, upper]).any():
                    weights = np.zeros((BOUNDED_DERIVATIVES, 3))
                    weights[derivative, axis] = 1.0
                    path.append(PathBound(weights, lower, upper, _size(lower, upper)))
        return cls(vehicle, problem, tuple(path))

    @property
    def lower(self) -> Array:
        """Lower ends, (M,)."""
        return np.array([*(b.lower for b in self.path), *self.vehicle.min_thrusts, -inf])

    @property
    def upper(self) -> Array:
        """Upper ends, (M,)."""
        return np.array(
            [*(b.upper for b in self.path), *self.vehicle.max_thrusts, self.vehicle.max_body_rate]
        )

    @property
    def sizes(self) -> Array:
        """The size of each, (M,)."""
        rate = self.vehicle.max_body_rate
        ranges = self.vehicle.max_thrusts - self.vehicle.min_thrusts
        return np.array([*(b.size for b in self.path), *ranges, rate if rate < inf else 1.0])

    def along(self, trajectory: Trajectory) -> Array:
        """The quantities at the looks of each interval, (K, looks, M)."""
        vehicle, times = self.vehicle, trajectory.knots[:-1, None] + LOOKS * trajectory.durations[:, None]
        derivatives = np.stack([trajectory.on_segments(LOOKS, k) for k in range(BOUNDED_DERIVATIVES)], axis=2)
        path = [np.sum(bound.weights * derivatives, axis=(-2, -1)) for bound in self.path]
        flat = reference(trajectory, vehicle, times.ravel(), environment=self.problem.environment)
        thrusts = flat.rotor_thrusts.reshape(*times.shape, -1)
        changes = np.einsum("ij,kjn->kin", DIFFERENTIATION, thrusts) / trajectory.durations[:, None, None]
        rate = np.linalg.norm(flat.setpoint.omega_body, axis=-1).reshape(*times.shape, 1)
        return np.concatenate(
            [*(p[..., None] for p in path), thrusts + vehicle.lags * changes, rate], axis=-1
        )


@dataclass(frozen=True, eq=False)
class Backoff:
    """How much more than its bounds each quantity keeps at the nodes of each interval."""

    low: Array  # above the lower ends, (K, M)
    high: Array  # below the upper ends, (K, M)

    @classmethod
    def none(cls, intervals: int, bounds: Bounds) -> Backoff:
        """Nothing more."""
        nothing = np.zeros((intervals, len(bounds.lower)))
        return cls(nothing, nothing)

    def grown(self, bounds: Bounds, trajectory: Trajectory, reserve: float = 0.0) -> Backoff | None:
        """The same with what a trajectory exceeds added; None where that leaves nothing, or nothing is.

        Of rotors, whose `reserve`, a fraction of their range, is kept from either of its ends, what it misses
        of that.

        Args:
            bounds: What holds all along.
            trajectory: The motion's.
            reserve: Of each rotor's range.
        """
        values, kept = bounds.along(trajectory), np.zeros_like(bounds.sizes)
        rotors = slice(len(bounds.path), -1)
        kept[rotors] = reserve * bounds.sizes[rotors]
        low = _raised(self.low, bounds.lower + kept + _largest(-values), bounds.sizes)
        high = _raised(self.high, _largest(values) - (bounds.upper - kept), bounds.sizes)
        unchanged = (low == self.low).all() and (high == self.high).all()
        if unchanged or (low + high > MAX_BACKOFF * (bounds.upper - bounds.lower) - 2.0 * kept).any():
            return None
        return replace(self, low=low, high=high)


def _largest(values: Array) -> Array:
    """The largest of values at the looks and of parabolas through three of them, (K, looks, M) -> (K, M)."""
    before, here, after = values[:, :-2], values[:, 1:-1], values[:, 2:]
    curvature = np.minimum(before - 2.0 * here + after, 0.0)
    peaked = (here >= before) & (here >= after) & (curvature < 0.0)
    rise = np.divide((after - before) ** 2, -8.0 * curvature, out=np.zeros_like(here), where=peaked)
    return np.asarray(np.maximum(values.max(axis=1), (here + rise).max(axis=1)))


def _raised(backoff: Array, excess: Array, sizes: Array) -> Array:
    """What is to be kept where so much is exceeded, (K, M).

    Twice what was kept where it is exceeded still: what lies in the middle of an interval may be far above
    its nodes, which then hold nothing until as much is kept there.
    """
    more = OVERSHOOT * np.maximum(excess, 0.0) + BACKOFF * sizes + np.where(excess > 0.0, backoff, 0.0)
    return backoff + np.where(excess > -NEAR * sizes, more, 0.0)


def _size(lower: float, upper: float) -> float:
    if np.isfinite([lower, upper]).all():
        return upper - lower
    return max(abs(lower) if lower > -inf else abs(upper), 1.0)
