"""The smallest feasible duration, whatever feasible means: one search, shared by the planners.

An attempt is a function of one number, the scale of time [s] (the MIQP's dt, say); it returns what it
found there, or None where nothing feasible exists.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Protocol, TypeVar, runtime_checkable

import numpy as np
from pydantic import Field

from aerobat.declaration import Count, FieldError, Fraction, Positive, declared

Found = TypeVar("Found")
Attempting = Callable[[float], Found | None]


@runtime_checkable
class Search(Protocol):
    """A way to look for the smallest feasible scale of time."""

    def smallest(self, attempt: Attempting[Found]) -> Found | None:
        """The find of the attempt at the smallest scale that the search reaches, or None."""
        ...


@declared
class GridSearch:
    """The first feasible of `count` equal steps from `first` to `last` [s] (paper, Section II)."""

    first: Positive = 0.1
    last: Positive = 4.0
    count: Count = 50

    def __post_init__(self) -> None:
        _require_order(self.first, self.last)

    def smallest(self, attempt: Attempting[Found]) -> Found | None:
        """Try each in turn and stop at the first that is feasible."""
        for scale in np.linspace(self.first, self.last, self.count).tolist():
            if (found := attempt(scale)) is not None:
                return found
        return None


@declared
class BisectionSearch:
    """Climb from `first` by `growth` until feasible, then halve the last step down to `tolerance`.

    Feasibility need not be monotone; the result is feasible, and the scale below it by the tolerance is
    not (a slow flip is infeasible again, so climbing from below finds the fast one).
    """

    first: Positive = 0.02  # [s]
    last: Positive = 1.0  # [s]
    growth: Annotated[float, Field(gt=1)] = 1.2
    tolerance: Fraction = 0.005  # relative

    def __post_init__(self) -> None:
        _require_order(self.first, self.last)

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


def _require_order(first: float, last: float) -> None:
    if last < first:
        raise FieldError("last", f"must be first ({first:g} s) or more, got {last:g}")
