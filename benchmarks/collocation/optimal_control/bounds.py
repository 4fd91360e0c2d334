"""Bounds along the whole motion, and how much more than them is kept at nodes, interval by interval."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import inf

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.flatness import reference
from aerobat.limits import MEASURES, Limit
from aerobat.limits.quantity import BODY_RATE, SPECIFIC_THRUST, UPRIGHT, WRENCH, WRENCH_RATE
from aerobat.planning.task import Task
from aerobat.trajectory import Trajectory
from collocation.optimal_control.collocation import BOUNDED_DERIVATIVES

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
class Bounds:
    """Limits along the whole motion, M of them in this order: on the path, on measures, on the body rate.

    The floor under the specific thrust is not among the M: it bounds an input.
    """

    task: Task
    path: tuple[Limit, ...]
    driven: tuple[Limit, ...]  # by the inputs: rotors and whatever else is no magnitude
    rate: Limit | None
    floor: Limit  # under the specific thrust

    @classmethod
    def of(cls, task: Task) -> Bounds:
        """Return a task's."""
        held, magnitudes = task.held, ((SPECIFIC_THRUST,), (BODY_RATE,))
        plain = [limit for limit in held if limit.quantity.measures not in magnitudes]
        return cls(
            task,
            path=tuple(limit for limit in plain if limit.quantity.is_of_path),
            driven=tuple(limit for limit in plain if not limit.quantity.is_of_path),
            rate=next((limit for limit in held if limit.quantity.measures == (BODY_RATE,)), None),
            floor=next(limit for limit in held if limit.quantity.measures == (SPECIFIC_THRUST,)),
        )

    @property
    def lower(self) -> Array:
        """Lower ends less what is constant, (M,)."""
        return np.array([*(limit.size * limit.ends[0] for limit in (*self.path, *self.driven)), -inf])

    @property
    def upper(self) -> Array:
        """Upper ends less what is constant, (M,)."""
        ends = (limit.size * limit.ends[1] for limit in (*self.path, *self.driven))
        return np.array([*ends, inf if self.rate is None else self.rate.upper])

    @property
    def sizes(self) -> Array:
        """The size of each, (M,)."""
        sizes = (limit.size for limit in (*self.path, *self.driven))
        return np.array([*sizes, 1.0 if self.rate is None else self.rate.size])

    def kept(self, reserve: float) -> Array:
        """The reserve that rotors keep from their lower and upper ends, zero of all else, (2, M)."""
        limits = (*self.path, *self.driven)
        shares = [(0.0, 0.0) if limit.rotor is None else limit.reserves(reserve) for limit in limits]
        return np.asarray(self.sizes * np.array([*shares, (0.0, 0.0)]).T)

    @cached_property
    def weights(self) -> Array:
        """Weights of the driven ones on the measures, (D, 11)."""
        return np.array([limit.quantity.measured for limit in self.driven]).reshape(-1, MEASURES)

    def along(self, trajectory: Trajectory) -> Array:
        """The quantities at the looks of each interval, (K, looks, M)."""
        times = trajectory.knots[:-1, None] + LOOKS * trajectory.durations[:, None]
        derivatives = np.stack([trajectory.on_segments(LOOKS, k) for k in range(BOUNDED_DERIVATIVES)], axis=2)
        path = [
            np.sum(limit.quantity.path[:BOUNDED_DERIVATIVES] * derivatives, axis=(-2, -1))
            for limit in self.path
        ]
        environment = self.task.environment
        flat = reference(trajectory, self.task.vehicle, times.ravel(), environment=environment)
        measures = np.zeros((*times.shape, MEASURES))
        wrench = flat.setpoint.wrench
        measures[..., WRENCH.start] = wrench.thrust.reshape(times.shape)
        measures[..., WRENCH.start + 1 : WRENCH.stop] = wrench.moment_body.reshape(*times.shape, 3)
        changes = np.einsum("ij,kjn->kin", DIFFERENTIATION, measures[..., WRENCH])
        measures[..., WRENCH_RATE] = changes / trajectory.durations[:, None, None]
        measures[..., UPRIGHT] = so3.thrust_axis(flat.setpoint.q_world_body)[:, 2].reshape(times.shape)
        rate = np.linalg.norm(flat.setpoint.omega_body, axis=-1).reshape(*times.shape, 1)
        return np.concatenate([*(p[..., None] for p in path), measures @ self.weights.T, rate], axis=-1)


@dataclass(frozen=True, eq=False)
class Backoff:
    """The tightening of each quantity's bounds at the nodes of each interval."""

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
        values, (below, above) = bounds.along(trajectory), bounds.kept(reserve)
        low = _raised(self.low, bounds.lower + below + _largest(-values), bounds.sizes)
        high = _raised(self.high, _largest(values) - (bounds.upper - above), bounds.sizes)
        unchanged = (low == self.low).all() and (high == self.high).all()
        if unchanged or (low + high > MAX_BACKOFF * (bounds.upper - bounds.lower) - below - above).any():
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
