"""Constraints of a program as they come: elements with the bounds of their rows."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from aerobat.arrays import Array, Indices
from collocation.separable import Element, ElementFunction


@dataclass
class Rows:
    """Constraints as they come."""

    elements: list[Element] = field(default_factory=list)
    lower: list[Array] = field(default_factory=list)
    upper: list[Array] = field(default_factory=list)
    count: int = 0

    def reserve(self, lower: Array, upper: Array) -> Indices:
        """Rows of their own with these bounds, of the bounds' shape."""
        rows = self.count + np.arange(lower.size).reshape(lower.shape)
        self.lower.append(lower.ravel())
        self.upper.append(upper.ravel())
        self.count += lower.size
        return rows

    def hold(
        self,
        function: ElementFunction,
        unknowns: Indices,
        lower: ArrayLike,
        upper: ArrayLike,
        parameters: ArrayLike = (),
    ) -> None:
        """lower ≤ values ≤ upper at every place, with the same parameters.

        Args:
            function: Of the values.
            unknowns: Of each place, a row each.
            lower: Of the values, of all places or of each.
            upper: Likewise.
            parameters: Of the function.
        """
        rows = self.reserve(np.atleast_2d(lower), np.atleast_2d(upper))
        self.elements.append(Element(function, unknowns, repeated(parameters, len(unknowns)), rows))


def repeated(parameters: ArrayLike, places: int) -> Array:
    """The same parameters for so many places, a row each."""
    return np.tile(np.atleast_1d(np.asarray(parameters, dtype=float)), (places, 1))
