"""The turn of the body about its thrust axis once around a closed course, which ends as it begins.

A body that never spins about its thrust axis comes back turned by the area on the unit sphere that the axis
goes around. Where the thrust f = |f| n changes by δf, the turn changes by ∮ (n' × n) · δf/|f| dt.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import legendre

from aerobat.arrays import Array
from aerobat.planning.refinement.excess import chebyshev
from aerobat.planning.refinement.limit_values import LimitValues

FRACTIONS = chebyshev(24)  # of every segment, (p,), its ends among them


@dataclass(frozen=True, eq=False)
class Closure:
    """The turn as a constraint on derivatives at `FRACTIONS` of all segments."""

    limits: LimitValues

    def values(self, derivatives: Array, durations: Array) -> Array:
        """The turn [rad], (1,), of derivatives (S, p, 6, 3) on segments that last so long [s], (S,)."""
        ends = np.cumsum(durations)
        times = (ends - durations)[:, None] + durations[:, None] * FRACTIONS
        axes = self.limits.frames(times.ravel(), derivatives.reshape(-1, 6, 3)).axes
        turn = axes[0].T @ axes[-1]
        return np.array([np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])])

    def slopes(self, derivatives: Array, durations: Array) -> Array:
        """The turn's slopes by the derivatives, (S, p, 6, 3)."""
        balance = self.limits.task.balance
        velocity, acceleration, jerk = np.moveaxis(derivatives[:, :, 1:4], 2, 0)
        thrust = balance.constant + acceleration + balance.drag * velocity
        turning = np.cross(jerk + balance.drag * acceleration, thrust)
        turning /= np.linalg.norm(thrust, axis=-1, keepdims=True) ** 3
        by_thrust = (durations[:, None] * self._weights)[..., None] * turning
        slopes = np.zeros_like(derivatives)
        slopes[:, :, 2], slopes[:, :, 1] = by_thrust, balance.drag * by_thrust
        return slopes

    @cached_property
    def _weights(self) -> Array:
        """Weights on values at places that integrate polynomials along a segment, (p,)."""
        count = len(FRACTIONS)
        values = legendre.legvander(2.0 * FRACTIONS - 1.0, count - 1)
        return np.asarray(np.linalg.solve(values.T, np.eye(count)[0]))
