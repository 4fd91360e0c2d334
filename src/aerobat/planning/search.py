"""Searches for the smallest feasible time scale, shared by the planners.

An attempt is a function of the time scale [s], such as the MIQP's dt. It returns a feasible result, or None.
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
    """A method to find the smallest feasible time scale."""

    def smallest(self, attempt: Attempting[Found]) -> Found | None:
        """Return the result at the smallest feasible scale that the search finds, or None."""
        ...


@declared
class GridSearch:
    """The first feasible of `count` equally spaced scales from `first` to `last` [s] (paper, Section II)."""

    first: Positive = 0.1
    last: Positive = 4.0
    count: Count = 50

    def __post_init__(self) -> None:
        _require_order(self.first, self.last)

    def smallest(self, attempt: Attempting[Found]) -> Found | None:
        """Return the result at the first feasible scale, in rising order, or None."""
        for scale in np.linspace(self.first, self.last, self.count).tolist():
            if (found := attempt(scale)) is not None:
                return found
        return None


@declared
class BisectionSearch:
    """Raise the scale from `first` by factors `growth` until feasible, then bisect down to `tolerance`.

    The result is feasible, and the scale below it by the tolerance is not. Feasibility need not be monotone:
    a slow flip is infeasible again, so the search rises from below to find the fast one.
    """

    first: Positive = 0.02  # [s]
    last: Positive = 1.0  # [s]
    growth: Annotated[float, Field(gt=1)] = 1.2
    tolerance: Fraction = 0.005  # relative

    def __post_init__(self) -> None:
        _require_order(self.first, self.last)

    def smallest(self, attempt: Attempting[Found]) -> Found | None:
        """Return the result at the smallest feasible scale found by rising and bisection, or None."""
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
