"""Bounds at nodes, drawn in so that what is asked holds between nodes too."""

from __future__ import annotations

import numpy as np

from aerobat.arrays import Array
from aerobat.problem.problem import Limits
from aerobat.trajectory import Trajectory

SPARE = 1e-4  # of a bound, by which it is drawn in beyond what was exceeded
ROUNDING = 1e-9  # in SI units: an excess that means nothing


def tightened(bounds: Limits, asked: Limits, trajectory: Trajectory, derivatives: int) -> Limits:
    """Bounds tighter by as much as the first derivatives of a trajectory exceed what is asked; or unchanged.

    Raises SpecError when nothing is left between them.
    """
    for derivative in range(derivatives):
        (lower, upper), (least, most) = asked.of(derivative), trajectory.component_range(derivative)
        below, above = _more(lower - least, lower), _more(most - upper, upper)
        if below.any() or above.any():
            bounds = bounds.tightened(derivative, below, above)
    return bounds


def _more(excess: Array, bound: Array) -> Array:
    """A little more than what is exceeded, and nothing where nothing but rounding is."""
    more, exceeded = np.zeros_like(excess), excess > ROUNDING
    more[exceeded] = excess[exceeded] + SPARE * np.abs(bound[exceeded])
    return more
