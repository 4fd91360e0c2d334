"""Bounds on position and its derivatives: what a problem's limits and a maneuver's conditions ask."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

from aerobat.arrays import Array
from aerobat.problem.condition import Condition, ForceBalance
from aerobat.problem.problem import DERIVATIVES, Problem
from aerobat.problem.stage import StageSequence
from aerobat.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Bound:
    """lower ≤ direction · (derivative of position) ≤ upper, in SI units."""

    derivative: int
    direction: Array  # (3,), world
    lower: float
    upper: float

    @classmethod
    def of(cls, condition: Condition, gravity: float) -> Bound:
        """Bound that a condition puts on its derivative."""
        bound = condition.bound(ForceBalance(gravity))
        return cls(condition.quantity.derivative, condition.direction, *bound.limits)

    @property
    def scale(self) -> float:
        """The size of what is bounded, for comparing with others."""
        if -inf < self.lower < self.upper < inf:
            return self.upper - self.lower
        return max((abs(x) for x in (self.lower, self.upper) if abs(x) < inf), default=0.0) or 1.0

    def excess(self, derivatives: Array) -> Array:
        """By how much values of the derivative (..., 3) exceed the bound, in SI units; negative: within."""
        values = derivatives @ self.direction
        return np.maximum(self.lower - values, values - self.upper)

    def excess_at(self, trajectory: Trajectory, time: float) -> float:
        """The same at a time [s] of a trajectory."""
        return float(self.excess(trajectory.evaluate(time, self.derivative)))


def path_bounds(problem: Problem, sequence: StageSequence, gravity: float) -> tuple[Bound, ...]:
    """Bounds along the whole path: the problem's limits, and what its sequence asks always."""
    limits = (
        Bound(derivative, axis, float(low), float(high))
        for derivative in range(len(DERIVATIVES))
        for axis, low, high in zip(np.eye(3), *problem.path_limits.of(derivative), strict=True)
        if low > -inf or high < inf
    )
    return (*limits, *(Bound.of(condition, gravity) for condition in sequence.path_constraints))
