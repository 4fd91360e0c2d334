"""A chain of integrators under piecewise constant input, condensed onto its inputs (paper, Section II).

Time is normalised by dt: the state's k-th derivative is dt^k d^k p/dt^k and the input is w = dt^r u. So the
matrices do not depend on dt and are reused along the search on dt.
"""

from __future__ import annotations

from functools import cached_property
from math import factorial
from typing import Annotated

import numpy as np
from pydantic import Field

from aerobat.arrays import Array
from aerobat.declaration import declared

INPUT_NAMES = {3: "jerk", 4: "snap", 5: "crackle"}
Order = Annotated[int, Field(ge=min(INPUT_NAMES), le=max(INPUT_NAMES))]
MAX_INTERVALS = 1000  # so many take half a gigabyte of matrices
Intervals = Annotated[int, Field(ge=1, le=MAX_INTERVALS)]


@declared
class IntegratorChain:
    """`order` integrators in a row, `intervals` intervals long, for one axis."""

    order: Order
    intervals: Intervals

    @cached_property
    def forced(self) -> Array:
        """The effect of the inputs at interval ends, (N, r, N): derivative d at interval n's end per input.

        An input on interval i < n acts through the Taylor weights of the time since: with k = n − i,
        ((k + 1)^(r−d) − k^(r−d)) / (r − d)!.
        """
        n, r = self.intervals, self.order
        elapsed = np.subtract.outer(np.arange(n), np.arange(n)).astype(float)
        powers = [
            np.clip(elapsed + 1, 0, None) ** (r - d) - np.clip(elapsed, 0, None) ** (r - d) for d in range(r)
        ]
        weights = np.array([1.0 / factorial(r - d) for d in range(r)])
        return np.asarray(np.stack(powers, axis=1) * weights[:, None])

    def free(self, initial: Array, dt: float) -> Array:
        """Return the normalised states (N, r, 3) at interval ends for zero input.

        The initial state (r, 3) is in SI units.
        """
        scaled = initial * self.scales(dt)[:, None]
        return np.asarray(self._taylor(np.arange(1.0, self.intervals + 1)) @ scaled)

    def scales(self, dt: float) -> Array:
        """Return dt^k for every derivative k of the state, (r,)."""
        return dt ** np.arange(float(self.order))

    def _taylor(self, elapsed: Array) -> Array:
        """Return the transition matrices (n, r, r) for zero input over times (n,), counted in intervals."""
        weights = np.zeros((len(elapsed), self.order, self.order))
        for d in range(self.order):
            for k in range(d, self.order):
                weights[:, d, k] = elapsed ** (k - d) / factorial(k - d)
        return weights
