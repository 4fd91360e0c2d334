"""The price of the state at a cut, moved to where a lower bound may be as high as is wanted."""

from __future__ import annotations

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization.assignment import unit_rows
from aerobat.optimization.branch_and_bound.least_distance import LeastDistanceQP, NotConverged
from aerobat.optimization.branch_and_bound.null_space import UNBOUNDED, in_units
from aerobat.optimization.branch_and_bound.time_decomposition.halves import HalfMinimum

OVERSHOOT = 0.5  # of what is missing, aimed at beyond the level: prices at the level come near it slowly
STIFFNESS = 0.03  # of the mean compliance, added in all directions: other solutions give way in others


class CuttingPlanes:
    """Cutting planes on the halves' minima at any price, from solutions at some prices: a level method [LNN].

    A solution of the half before the cut that costs c at the price q, with the state z, costs c + (q′ − q)ᵀz
    at q′, so that the minimum there is no higher; behind the cut the state counts negative. Distances between
    prices are measured by what the halves' minima lose along them, their compliance.
    """

    def __init__(self, size: int) -> None:
        """Begin without planes, for prices (size,)."""
        self._slopes = np.zeros((2, 0, size))
        self._offsets = np.zeros((2, 0))
        self._metric = np.eye(size)  # a factor L of L Lᵀ

    def add(self, price: Array, before: HalfMinimum, behind: HalfMinimum) -> None:
        """Take both halves' solutions at a price."""
        slopes = np.stack([before.state, -behind.state])
        offsets = np.array([before.cost, behind.cost]) - slopes @ price
        self._slopes = np.concatenate([self._slopes, slopes[:, None]], axis=1)
        self._offsets = np.concatenate([self._offsets, offsets[:, None]], axis=1)
        compliance = before.compliance + behind.compliance
        least = STIFFNESS * np.trace(compliance) / len(price)
        self._metric = np.linalg.cholesky(compliance + (least or 1.0) * np.eye(len(price)))

    def nearest(self, center: Array, level: float, reached: float) -> Array | None:
        """The price nearest to `center` where both minima may add up to `level`, or somewhat more.

        None where they nowhere can: the halves' solutions differ too much. `reached` is their sum so far.
        """
        slopes = (self._slopes[0][:, None] + self._slopes[1]).reshape(-1, len(center))
        offsets = np.add.outer(*self._offsets).ravel()
        scaled = np.linalg.solve(self._metric, slopes.T).T
        for aim in (level + OVERSHOOT * (level - reached), level):
            step = _shortest(scaled, aim - offsets - slopes @ center)
            if step is not None:
                return np.asarray(center + np.linalg.solve(self._metric.T, step))
        return None


def _shortest(rows: Array, lower: Array) -> Array | None:
    """The shortest vector of which rows are at least so much; None where there is none."""
    norms, rows = unit_rows(rows)
    lower = lower / norms
    unit = float(np.abs(lower).max()) or 1.0
    try:
        solution = LeastDistanceQP(rows).solve(in_units(lower, unit), np.full(len(lower), UNBOUNDED))
    except NotConverged:
        return None
    return None if solution is None else np.asarray(unit * solution.y)
