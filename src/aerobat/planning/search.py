"""The smallest feasible duration, whatever feasible means: one search, shared by the planners.

An attempt is a function of one number, the scale of time [s] (the MIQP's dt, say); it returns what it
found there, or None where nothing feasible exists.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from aerobat.errors import SpecError

Found = TypeVar("Found")
Attempting = Callable[[float], Found | None]


class Search(Protocol):
    """A way to look for the smallest feasible scale of time."""

    def smallest(self, attempt: Attempting[Found]) -> Found | None:
        """What the attempt found at the smallest scale that the search reaches, or None."""
        ...


@dataclass(frozen=True)
class GridSearch:
    """The first feasible of `count` equal steps from `first` to `last` [s] (paper, Section II)."""

    first: float = 0.1
    last: float = 4.0
    count: int = 50

    def __post_init__(self) -> None:
        """Check."""
        if not (0.0 < self.first <= self.last < np.inf and self.count >= 1):
            raise SpecError(
                "the search's grid needs 0 < first <= last in seconds and at least one step, "
                f"got first={self.first}, last={self.last}, count={self.count}"
            )

    def smallest(self, attempt: Attempting[Found]) -> Found | None:
        """Try each in turn and stop at the first that is feasible."""
        for scale in np.linspace(self.first, self.last, self.count).tolist():
            if (found := attempt(scale)) is not None:
                return found
        return None


@dataclass(frozen=True)
class BisectionSearch:
    """Climb from `first` by `growth` until feasible, then halve the last step down to `tolerance`.

    Feasibility need not be monotone; the result is feasible, and the scale below it by the tolerance is
    not (a slow flip is infeasible again, so climbing from below finds the fast one).
    """

    first: float = 0.02  # [s]
    last: float = 1.0  # [s]
    growth: float = 1.2
    tolerance: float = 0.005  # relative

    def __post_init__(self) -> None:
        """Check."""
        if not (0.0 < self.first <= self.last < np.inf and self.growth > 1.0 and 0.0 < self.tolerance < 1.0):
            raise SpecError(
                "the search needs 0 < first <= last in seconds, growth > 1 and 0 < tolerance < 1, got "
                f"first={self.first}, last={self.last}, growth={self.growth}, tolerance={self.tolerance}"
            )

    def smallest(self, attempt: Attempting[Found]) -> Found | None:
        """Climb, then bisect between the last infeasible and the first feasible."""
        below, scale = None, self.first
        while (found := attempt(scale)) is None:
            if scale >= self.last:
                return None
            below, scale = scale, min(scale * self.growth, self.last)
        while below is not None and scale / below > 1.0 + self.tolerance:
            middle = float(np.sqrt(below * scale))
            if (better := attempt(middle)) is None:
                below = middle
            else:
                found, scale = better, middle
        return found
