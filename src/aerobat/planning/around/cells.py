"""A grid of cells between obstacles, with the cost of a step through each cell.

A cell is free if its centre is clear of all obstacle pieces by the body's smallest semi-axis, as a body on
its side passes where a level body does not fit. Cells closer to a piece than the body's reach cost more, so
that routes keep their distance where there is room. Moving pieces are evaluated when the body is expected in
a cell. That time is the expected duration times the distance from the start, over the sum of the distances
from start and goal.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import ceil

import numpy as np

from aerobat.arrays import Array, Indices, Mask
from aerobat.environment.obstacles import Pieces
from aerobat.vehicle import Ellipsoid

CELLS = 25_000  # approximate number of cells, with which a shortest path takes 0.1 s
MIN_CELL_SIZE = 0.1  # least side of a cell [m]
GRID_MARGIN = 3.0  # margin of the grid around the positions to pass [m]
EXACT_WITHIN = 1.2  # distance [m] from a piece within which it is exact; farther away its box is used
ROOM = 0.15  # distance [m] beyond the body's reach within which cells cost more
CLEARANCE_COST = 4.0  # added cost per metre where the body on its side just fits
STEPS = np.array([step for step in product((-1, 0, 1), repeat=3) if step > (0, 0, 0)])


@dataclass(frozen=True, eq=False)
class Cells:
    """A grid of cells in a box in the world."""

    pieces: Pieces
    body: Ellipsoid
    lower: Array  # [m] lower corner of the box, (3,)
    upper: Array  # [m] upper corner of the box, (3,)
    ends: Array  # [m] start and goal, (2, 3)
    duration: float  # [s] expected from start to goal, for the positions of moving pieces

    @classmethod
    def around(
        cls, pieces: Pieces, body: Ellipsoid, places: Array, lower: Array, upper: Array, duration: float
    ) -> Cells:
        """Return the grid around positions to pass.

        Args:
            pieces: Pieces of all obstacles.
            body: The body that passes between them.
            places: Positions [m], (k, 3), in the order in which they are passed.
            lower: Lower corner of the allowed volume [m], −infinite where it is open.
            upper: Upper corner of the allowed volume [m], infinite where it is open.
            duration: Expected duration from the first position to the last [s].
        """
        low = np.maximum(places.min(axis=0) - GRID_MARGIN, lower)
        high = np.minimum(places.max(axis=0) + GRID_MARGIN, upper)
        return cls(pieces, body, low, high, places[[0, -1]], duration)

    @property
    def room(self) -> float:
        """The distance [m] from pieces at which the body has room in any attitude."""
        return self.body.revolved.reach + ROOM

    @cached_property
    def step(self) -> float:
        """The approximate length of a cell's side [m]."""
        return max(MIN_CELL_SIZE, float((np.prod(self.upper - self.lower) / CELLS) ** (1.0 / 3.0)))

    @cached_property
    def shape(self) -> tuple[int, int, int]:
        """The number of cells along each axis."""
        counts = [max(1, ceil(side / self.step)) for side in (self.upper - self.lower).tolist()]
        return counts[0], counts[1], counts[2]

    @cached_property
    def centres(self) -> Array:
        """The centres of all cells [m], (n, 3)."""
        axes = [
            low + (np.arange(count) + 0.5) * (high - low) / count
            for low, high, count in zip(self.lower, self.upper, self.shape, strict=True)
        ]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)

    def distances(self, points: Array, exact_within: float) -> Array:
        """Return lower bounds on the distances of points to the nearest piece [m], (n,).

        Moving pieces are where they are when the body is expected at the point.
        """
        before, after = np.linalg.norm(points - self.ends[:, None], axis=-1)
        times = self.duration * before / np.maximum(before + after, self.step)
        return self.pieces.distances(points, exact_within, times)

    @cached_property
    def clearance(self) -> Array:
        """Lower bounds on the distances of all centres to the nearest piece [m], (n,)."""
        return self.distances(self.centres, EXACT_WITHIN)

    @cached_property
    def free(self) -> Mask:
        """The mask of the cells that a body may be in, (n,)."""
        return self.clearance > self.body.revolved.high

    @cached_property
    def cost(self) -> Array:
        """The cost of a metre through a cell, (n,)."""
        close = (self.room - self.clearance) / (self.room - self.body.revolved.high)
        return 1.0 + CLEARANCE_COST * np.clip(close, 0.0, 1.0)

    def cell(self, points: Array) -> Indices:
        """Return the cells (...) that contain points [m] (..., 3), or are nearest to points outside."""
        counts = np.array(self.shape)
        found = np.floor((points - self.lower) / (self.upper - self.lower) * counts).astype(np.intp)
        x, y, z = np.moveaxis(np.clip(found, 0, counts - 1), -1, 0)
        return np.asarray((x * counts[1] + y) * counts[2] + z)

    def nearest(self, place: Array) -> int:
        """Return the free cell that is nearest to a position [m] (3,)."""
        away = np.linalg.norm(self.centres - place, axis=1)
        return int(np.argmin(np.where(self.free, away, np.inf)))

    def cheapest_path(self, begin: int, end: int, factor: Array) -> Indices | None:
        """Return the cells (k,) of the cheapest route between two cells, with costs times `factor` (n,).

        Return None where there is no route.
        """
        from scipy.sparse import csr_matrix
        from scipy.sparse.csgraph import dijkstra

        first, second, length = self._edges
        cost = self.cost * factor
        weights = length * (cost[first] + cost[second]) / 2.0
        graph = csr_matrix((weights, (first, second)), shape=(len(cost), len(cost)))
        found, before = dijkstra(graph, directed=False, indices=begin, return_predecessors=True)
        if not np.isfinite(found[end]):
            return None
        cells = [end]
        while cells[-1] != begin:
            cells.append(int(before[cells[-1]]))
        return np.array(cells[::-1], dtype=np.intp)

    @cached_property
    def _edges(self) -> tuple[Indices, Indices, Array]:
        """The pairs of neighbouring cells that are both free, and the distances of their centres [m]."""
        numbers = np.arange(len(self.centres)).reshape(self.shape)
        sides = (self.upper - self.lower) / self.shape
        firsts, seconds, lengths = [], [], []
        for step in STEPS:
            first = numbers[tuple(slice(max(-by, 0), min(-by, 0) or None) for by in step.tolist())].ravel()
            second = numbers[tuple(slice(max(by, 0), min(by, 0) or None) for by in step.tolist())].ravel()
            both = self.free[first] & self.free[second]
            firsts.append(first[both])
            seconds.append(second[both])
            lengths.append(np.full(int(both.sum()), np.linalg.norm(step * sides)))
        return np.concatenate(firsts), np.concatenate(seconds), np.concatenate(lengths)
