"""Routes through places: the cheapest ways on a grid, then others on different sides of what stands between.

Where a route passes between things, a curtain is drawn from wall to wall across it, and what lies in it costs
more: the next cheapest route takes another passage, if that is not much longer. Two routes that can be moved
into one another with nothing in between are one (Zhou et al., RAPTOR, 2021: uniform visibility deformation).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from aerobat.arrays import Array, Indices
from aerobat.planning.around.cells import LOOKED_WITHIN, Cells

BETWEEN = LOOKED_WITHIN  # [m] from a route to what it passes, at most, that a curtain hangs on
WIDE = 4.0  # [m] from a route, that a curtain reaches at most
DETOUR = 1.5  # [m] that it costs to pass a curtain
LOOKED_AT = 24  # places of a straight line, at which it is looked whether it is free
COMPARED = 20  # places of two routes

Leg = tuple[Array, Array]  # its two ends [m]


class Way(NamedTuple):
    """A way through places."""

    legs: tuple[Array, ...]  # the points of each [m], a cell a step, (k, 3), its ends included
    clearance: float  # [m] the least distance of a point on it to a piece


def routes(grid: Cells, legs: Sequence[Leg], count: int) -> Iterator[Way]:
    """Yield up to so many routes; none where there is no way.

    Args:
        grid: Around the places.
        legs: In the order in which they are flown.
        count: Of the routes.
    """
    ends = [(grid.nearest(begin), grid.nearest(end)) for begin, end in legs]
    factor = np.ones(len(grid.centres))
    known: list[Array] = []
    for _ in range(count):
        found = [grid.way(begin, end, factor) for begin, end in ends]
        ways = [way for way in found if way is not None]
        if len(ways) < len(found):
            return
        whole = np.concatenate(ways)
        points = grid.centres[whole]
        if not any(_is_alike(grid, points, other) for other in known):
            flown = (
                np.concatenate([[begin], grid.centres[way[1:-1]], [end]])
                for (begin, end), way in zip(legs, ways, strict=True)
            )
            yield Way(tuple(flown), float(grid.clearance[whole].min()))
            known.append(points)
        factor = _with_curtains(grid, whole, factor)


def straightened(grid: Cells, points: Array, slack: float) -> Array:
    """Return the corners that a way needs: from each the farthest that is reached straight.

    Args:
        grid: That the way goes through.
        points: Of the way [m], (k, 3).
        slack: Of a cell, by which a straight line may come nearer to pieces than the way, where the body has
            no room.
    """
    kept, at = [0], 0
    while at < len(points) - 1:
        to = len(points) - 1
        while to > at + 1 and not _is_straight(grid, points[at : to + 1], slack):
            to = at + max(1, (to - at) * 3 // 4)
        kept.append(to)
        at = to
    return np.asarray(points[kept])


def _is_straight(grid: Cells, points: Array, slack: float) -> bool:
    """True if the straight line between the ends is everywhere as clear as the way beside it, or has room."""
    along = grid.distances(_spaced(points), grid.room)
    beside = np.minimum(along, np.minimum(np.roll(along, 1), np.roll(along, -1)))
    line = grid.distances(_spaced(points[[0, -1]]), grid.room)
    return bool((line >= np.minimum(beside, grid.room) - slack * grid.step).all())


def _with_curtains(grid: Cells, way: Indices, factor: Array) -> Array:
    """The factors, more in curtains across a way where it passes between things."""
    clearance, points = grid.clearance[way], grid.centres[way]
    factor = factor.copy()
    for k in range(1, len(way) - 1):
        if clearance[k] > min(clearance[k - 1], clearance[k + 1], BETWEEN):
            continue
        along = points[k + 1] - points[k - 1]
        along /= max(float(np.linalg.norm(along)), 1e-9)
        offset = grid.centres - points[k]
        near = (np.abs(offset @ along) <= grid.step) & (np.linalg.norm(offset, axis=1) < WIDE) & grid.free
        cells = np.flatnonzero(near)
        lines = _line(points[k], grid.centres[cells])
        seen = grid.free[grid.cell(lines)].all(axis=0)
        factor[cells[seen]] = np.maximum(factor[cells[seen]], 1.0 + DETOUR / (2.0 * grid.step))
    return factor


def _is_alike(grid: Cells, route: Array, other: Array) -> bool:
    """True if straight lines between points of two routes, in their order, are free."""
    lines = _line(_spaced(route), _spaced(other))
    return bool(grid.free[grid.cell(lines)].all())


def _spaced(points: Array) -> Array:
    """Points evenly along a route, (COMPARED, 3)."""
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    at = np.linspace(0.0, length[-1], COMPARED)
    return np.column_stack([np.interp(at, length, points[:, axis]) for axis in range(3)])


def _line(begin: Array, end: Array) -> Array:
    """Points along straight lines, (LOOKED_AT, ..., 3)."""
    return np.linspace(np.broadcast_to(begin, end.shape), end, LOOKED_AT)
