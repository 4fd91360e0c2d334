"""The greatest values of Chebyshev series, enclosed: branch and bound by halving intervals.

On an interval a series is at most the maximum of its first three terms, a parabola, plus the sizes of all
others. Halving shrinks these by eight, and wherever the bound stays below a value known, nothing remains
to be looked for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.certification.enclosure import chebyshev

MAX_HALVINGS = 50
Indices = NDArray[np.intp]


@dataclass(frozen=True)
class SeriesBatch:
    """Series that approximate functions, each of one of G groups whose greatest value is wanted.

    The ends of an enclosure come as near to one another as `tightness` says: of the group's scale or of its
    greatest value, whichever is larger, errors aside.
    """

    coefficients: Array  # (N, K + 1)
    error: Array  # between function and series, at most, (N,)
    group: Indices  # (N,)
    scale: Array  # what is large for a group, (G,)
    tightness: float


@dataclass(frozen=True)
class Enclosure:
    """For each group: least <= sup <= most, and where at least `least` is taken. All (G,)."""

    least: Array
    most: Array
    member: Indices
    position: Array  # in [-1, 1], on that member's interval


@dataclass(frozen=True)
class _Parts:
    """Parts of members' intervals: the series there, stretched to [-1, 1]."""

    coefficients: Array  # (n, K + 1)
    member: Indices  # (n,)
    middle: Array  # (n,)
    half: Array  # (n,)

    def __getitem__(self, rows: Indices) -> _Parts:
        return _Parts(self.coefficients[rows], self.member[rows], self.middle[rows], self.half[rows])

    def halves(self) -> _Parts:
        """Both halves of every part."""
        lower, upper = chebyshev.basis(self.coefficients.shape[1] - 1).halves
        half = self.half / 2
        return _Parts(
            np.concatenate([self.coefficients @ lower.T, self.coefficients @ upper.T]),
            np.concatenate([self.member, self.member]),
            np.concatenate([self.middle - half, self.middle + half]),
            np.concatenate([half, half]),
        )


def enclose_maximum(family: SeriesBatch) -> Enclosure:
    """Enclose the greatest value of each group, all groups at once."""
    count, groups = len(family.group), len(family.scale)
    parts = _Parts(family.coefficients, np.arange(count), np.zeros(count), np.ones(count))
    found = Enclosure(
        np.full(groups, -np.inf), np.full(groups, -np.inf), np.zeros(groups, dtype=np.intp), np.zeros(groups)
    )
    for halving in range(MAX_HALVINGS):
        group, error = family.group[parts.member], family.error[parts.member]
        slack = family.tightness / 10 * family.scale
        peak, tail, vertex = _parabola(parts.coefficients, slack[group])
        upper = peak + tail + error
        value = chebyshev.evaluate(parts.coefficients, vertex) - error
        _improve(found, parts, group, vertex, value, slack)
        tolerance = family.tightness * np.maximum(family.scale, np.abs(found.least))[group]
        open_ = (upper > found.least[group] + tolerance) & (tail > tolerance / 4)
        if halving == MAX_HALVINGS - 1:
            open_[:] = False
        np.maximum.at(found.most, group[~open_], upper[~open_])
        if not open_.any():
            break
        parts = parts[np.flatnonzero(open_)].halves()
    return found


def _parabola(coefficients: Array, flat: Array) -> tuple[Array, Array, Array]:
    """The maximum of c0 T0 + c1 T1 + c2 T2 on [-1, 1], the sizes of all other terms, and where it is.

    That is said to be at -1 where these terms change by less than `flat` (n,).
    """
    padded = coefficients if coefficients.shape[1] > 2 else np.pad(coefficients, ((0, 0), (0, 2)))
    c0, c1, c2 = padded[:, :3].T
    inside = (c2 < 0) & (np.abs(c1) < -4 * c2)
    steep = np.where(inside, c2, -1.0)
    vertex = np.where(inside, -c1 / (4 * steep), np.where(c1 < 0, -1.0, 1.0))
    peak = np.where(inside, c0 - steep - c1**2 / (8 * steep), c0 + c2 + np.abs(c1))
    vertex = np.where(np.abs(c1) + np.abs(c2) < flat / 2, -1.0, vertex)
    return peak, np.abs(padded[:, 3:]).sum(axis=1), vertex


def _improve(
    found: Enclosure, parts: _Parts, group: Indices, vertex: Array, value: Array, slack: Array
) -> None:
    """Enter values that exceed those known by more than a `slack` (G,); of equal ones the earliest."""
    greatest = found.least.copy()
    np.maximum.at(greatest, group, value)
    position = parts.middle + parts.half * vertex
    better = (greatest > found.least + slack)[group] & (value >= greatest[group] - slack[group])
    order = np.lexsort((-position, -parts.member))  # of several of one group the last assigned stays
    order = order[better[order]]
    at = group[order]
    found.least[at], found.member[at], found.position[at] = value[order], parts.member[order], position[order]
