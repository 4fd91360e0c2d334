"""Bounds on a path that are linear in its derivatives: limits per axis, and what holds throughout."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite

import numpy as np

from aerobat.arrays import AXES, Array
from aerobat.planning.miqp.refinement.phases import DERIVATIVES
from aerobat.problem.condition import Condition, ForceBalance
from aerobat.problem.problem import DERIVATIVES as QUANTITIES
from aerobat.problem.problem import Limits


@dataclass(frozen=True, eq=False)
class PathRows:
    """Constraints weights · derivatives ≤ bound, each over its size."""

    weights: Array  # (c, 6, 3)
    bounds: Array  # (c,)
    names: tuple[str, ...]  # of each, with its verb

    @classmethod
    def of(
        cls, limits: Limits, order: int, conditions: tuple[Condition, ...], balance: ForceBalance
    ) -> PathRows:
        """Limits on derivatives up to the order, and conditions.

        Args:
            limits: per axis.
            order: of the derivative that is the input.
            conditions: what holds throughout.
            balance: what thrust works against.
        """
        rows = list(_of_limits(limits, order))
        for condition in conditions:
            rows += [(f"{condition.name} is", *side) for side in of_conditions((condition,), balance)]
        weights = np.array([row[1] for row in rows]).reshape(-1, DERIVATIVES, 3)
        return cls(weights, np.array([row[2] for row in rows]), tuple(row[0] for row in rows))

    def values(self, derivatives: Array) -> Array:
        """The constraints at derivatives (m, 6, 3), (m, c), at most zero where they hold."""
        return np.asarray(np.einsum("mka,cka->mc", derivatives, self.weights) - self.bounds)


def of_conditions(
    conditions: tuple[Condition, ...], balance: ForceBalance, equalities: bool = True
) -> Iterator[tuple[Array, float]]:
    """The bounds of conditions as rows (6, 3) and their bounds, over their sizes.

    Args:
        conditions: Each bounds one quantity from one side or both.
        balance: What thrust works against.
        equalities: False to leave out those whose bounds are equal.
    """
    for condition in conditions:
        bound = condition.bound(balance)
        if bound.lower == bound.upper and not equalities:
            continue
        weights = np.zeros((DERIVATIVES, 3))
        weights[:3] = bound.weights
        for sign, limit in zip((-1.0, 1.0), bound.limits, strict=True):
            if isfinite(limit):
                size = max(bound.scale, abs(limit))
                yield sign * weights / size, sign * limit / size


def _of_limits(limits: Limits, order: int) -> Iterator[tuple[str, Array, float]]:
    for derivative in range(order + 1):
        for sign, bounds in zip((-1.0, 1.0), limits.of(derivative), strict=True):
            for axis in np.flatnonzero(np.isfinite(bounds)).tolist():
                size = max(abs(float(bounds[axis])), 1.0)
                weights = np.zeros((DERIVATIVES, 3))
                weights[derivative, axis] = sign / size
                name = f"the {QUANTITIES[derivative]} {AXES[axis]} is"
                yield name, weights, sign * float(bounds[axis]) / size
