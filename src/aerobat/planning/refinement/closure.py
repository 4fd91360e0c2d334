"""Closure of a closed course: after one lap the body has its initial attitude, yaw included.

A body that never rotates about its thrust axis n returns turned about n by an angle, the holonomy. This angle
is the area on the unit sphere that n encloses. A change δf of the thrust f = |f| n changes the angle by
∮ (n' × n) · δf/|f| dt.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import legendre

from aerobat.arrays import Array
from aerobat.planning.refinement.limit_values import LimitValues
from aerobat.planning.refinement.spline import chebyshev

FRACTIONS = chebyshev(24)  # places of every segment, both ends included, (p,)


@dataclass(frozen=True, eq=False)
class Closure:
    """The turn about the thrust axis, constrained to zero, as a function of derivatives at `FRACTIONS`."""

    limits: LimitValues

    def values(self, derivatives: Array, durations: Array) -> Array:
        """Return the turn [rad], (1,), from derivatives (S, p, 6, 3) and segment durations [s], (S,)."""
        starts = np.concatenate([[0.0], np.cumsum(durations)[:-1]])  # bit by bit where the last segments end
        times = starts[:, None] + durations[:, None] * FRACTIONS
        axes = self.limits.frames(times.ravel(), derivatives.reshape(-1, 6, 3)).axes
        turn = axes[0].T @ axes[-1]
        return np.array([np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])])

    def slopes(self, derivatives: Array, durations: Array) -> Array:
        """Return the turn's slopes by the derivatives, (S, p, 6, 3)."""
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
        """The quadrature weights of `FRACTIONS`, exact for polynomials of degree p − 1, (p,)."""
        count = len(FRACTIONS)
        values = legendre.legvander(2.0 * FRACTIONS - 1.0, count - 1)
        return np.asarray(np.linalg.solve(values.T, np.eye(count)[0]))
