"""A chain of integrators under piecewise constant input, condensed onto its inputs (paper, Section II).

Time is normalised by dt: the state's k-th derivative is dt^k d^k p/dt^k and the input w = dt^r u, so that
every matrix is free of dt and can be kept along the search on dt.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import factorial

import numpy as np

from aerobat.arrays import Array
from aerobat.errors import SpecError

INPUT_NAMES = {3: "jerk", 4: "snap", 5: "crackle"}


@dataclass(frozen=True)
class IntegratorChain:
    """`order` integrators in a row, `intervals` intervals long, for one axis.

    Raises SpecError for an order outside 3, 4, 5 or fewer than one interval.
    """

    order: int
    intervals: int

    def __post_init__(self) -> None:
        """Check."""
        if self.order not in INPUT_NAMES:
            raise SpecError(f"order must be 3 (jerk input), 4 (snap) or 5 (crackle), got {self.order}")
        if not 1 <= self.intervals <= 10_000:
            raise SpecError(f"intervals must be a whole number from 1 to 10000, got {self.intervals}")

    @cached_property
    def forced(self) -> Array:
        """What the inputs add at interval ends, (N, r, N): derivative d at the end of interval n per input.

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
        """What the initial state (r, 3) in SI units leads to without input, normalised, (N, r, 3)."""
        scaled = initial * self.scales(dt)[:, None]
        ends = np.arange(1.0, self.intervals + 1)
        taylor = np.zeros((self.intervals, self.order, self.order))
        for d in range(self.order):
            for k in range(d, self.order):
                taylor[:, d, k] = ends ** (k - d) / factorial(k - d)
        return np.asarray(taylor @ scaled)

    def scales(self, dt: float) -> Array:
        """dt^k for every derivative of the state, (r,)."""
        return dt ** np.arange(float(self.order))
