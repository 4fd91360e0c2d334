"""Topologically distinct routes on a grid: the cheapest one, then others on different sides of obstacles.

Where a route passes a gap between obstacles, the cells across the gap, its "curtain", get a higher cost. So
the next cheapest route takes another gap, if that is not much longer. Two routes count as one if one can be
deformed into the other without crossing an obstacle (Zhou et al., RAPTOR, 2021: uniform visibility
deformation).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from aerobat.arrays import Array, Indices
from aerobat.planning.around.cells import EXACT_WITHIN, Cells

BETWEEN = EXACT_WITHIN  # largest distance [m] of a route from obstacles at which a curtain is drawn
CURTAIN_RADIUS = 4.0  # largest distance [m] of a curtain's cells from the route
DETOUR = 1.5  # cost of passing a curtain, as a length [m]
LINE_SAMPLES = 24  # samples of a straight line that is tested for collision
ROUTE_SAMPLES = 20  # samples of two routes that are compared

Leg = tuple[Array, Array]  # its two ends [m]


class GridRoute(NamedTuple):
    """A route through positions."""

    legs: tuple[Array, ...]  # the points of each leg [m], cell by cell, both ends included, (k, 3)
    clearance: float  # [m] the least distance of the route's cells to a piece


def routes(grid: Cells, legs: Sequence[Leg], count: int) -> Iterator[GridRoute]:
    """Yield distinct routes, the cheapest first; none where a leg has no route.

    Args:
        grid: The grid around the legs.
        legs: The ends of the legs, in the order of flight.
        count: Number of searches, at most one route each.
    """
    ends = [(grid.nearest(begin), grid.nearest(end)) for begin, end in legs]
    factor = np.ones(len(grid.centres))
    known: list[Array] = []
    for _ in range(count):
        found = [grid.cheapest_path(begin, end, factor) for begin, end in ends]
        paths = [path for path in found if path is not None]
        if len(paths) < len(found):
            return
        whole = np.concatenate(paths)
        points = grid.centres[whole]
        if not any(_is_alike(grid, points, other) for other in known):
            flown = (
                np.concatenate([[begin], grid.centres[path[1:-1]], [end]])
                for (begin, end), path in zip(legs, paths, strict=True)
            )
            yield GridRoute(tuple(flown), float(grid.clearance[whole].min()))
            known.append(points)
        factor = _with_curtains(grid, whole, factor)


def straightened(grid: Cells, points: Array, slack: float) -> Array:
    """Return the corners of a route after shortcuts along straight lines that are clear of obstacles.

    Args:
        grid: The grid of the route.
        points: Points of the route [m], (k, 3).
        slack: By how much a straight line may come closer to pieces than the route where the body has no
            room, in cells.
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
    """Return whether the straight line between the ends has everywhere room, or the route's own clearance."""
    along = grid.distances(_spaced(points), grid.room)
    beside = np.minimum(along, np.minimum(np.roll(along, 1), np.roll(along, -1)))
    line = grid.distances(_spaced(points[[0, -1]]), grid.room)
    return bool((line >= np.minimum(beside, grid.room) - slack * grid.step).all())


def _with_curtains(grid: Cells, path: Indices, factor: Array) -> Array:
    """Return the cost factors, raised in curtains across a route where it passes between obstacles."""
    clearance, points = grid.clearance[path], grid.centres[path]
    factor = factor.copy()
    for k in range(1, len(path) - 1):
        if clearance[k] > min(clearance[k - 1], clearance[k + 1], BETWEEN):
            continue
        along = points[k + 1] - points[k - 1]
        along /= max(float(np.linalg.norm(along)), 1e-9)
        offset = grid.centres - points[k]
        distance = np.linalg.norm(offset, axis=1)
        near = (np.abs(offset @ along) <= grid.step) & (distance < CURTAIN_RADIUS) & grid.free
        cells = np.flatnonzero(near)
        lines = _line(points[k], grid.centres[cells])
        seen = grid.free[grid.cell(lines)].all(axis=0)
        factor[cells[seen]] = np.maximum(factor[cells[seen]], 1.0 + DETOUR / (2.0 * grid.step))
    return factor


def _is_alike(grid: Cells, route: Array, other: Array) -> bool:
    """Return whether the straight lines between corresponding points of two routes are all free."""
    lines = _line(_spaced(route), _spaced(other))
    return bool(grid.free[grid.cell(lines)].all())


def _spaced(points: Array) -> Array:
    """Return points evenly spaced along a route, (ROUTE_SAMPLES, 3)."""
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    at = np.linspace(0.0, length[-1], ROUTE_SAMPLES)
    return np.column_stack([np.interp(at, length, points[:, axis]) for axis in range(3)])


def _line(begin: Array, end: Array) -> Array:
    """Return points along straight lines, (LINE_SAMPLES, ..., 3)."""
    return np.linspace(np.broadcast_to(begin, end.shape), end, LINE_SAMPLES)
