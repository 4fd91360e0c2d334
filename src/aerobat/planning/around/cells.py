"""A grid of cells between obstacles, with what a step through each of them costs.

A cell is free where a point in its middle is clear of all pieces by the body's least semi-axis: a body on its
side passes where it does not level. Cells nearer to a piece than the body reaches cost more, so that a way
keeps off where there is room. Pieces that move are where they are when the body comes by: a cell is passed as
late as it is far from the start beside the goal.
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

CELLS = 25_000  # about so many: a way through takes a tenth of a second
FINEST = 0.1  # [m] of a cell
AROUND = 3.0  # [m] beyond the places to pass, that a grid reaches to all sides
LOOKED_WITHIN = 1.2  # [m] from a piece's box, beyond which that is as good as the piece
ROOM = 0.15  # [m] beyond the body's reach, within which cells cost more
CLOSE = 4.0  # times its length, that a step costs more where the body on its side just fits
STEPS = np.array([step for step in product((-1, 0, 1), repeat=3) if step > (0, 0, 0)])


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells of a box in the world."""

    pieces: Pieces
    body: Ellipsoid
    lower: Array  # [m] the box's corner, (3,)
    upper: Array  # [m] the opposite one, (3,)
    ends: Array  # [m] where all begins and ends, (2, 3)
    duration: float  # [s] from end to end, about: when the body is in a cell, where pieces are then

    @classmethod
    def around(
        cls, pieces: Pieces, body: Ellipsoid, places: Array, lower: Array, upper: Array, duration: float
    ) -> Cells:
        """Return the grid around places to pass.

        Args:
            pieces: Of all obstacles.
            body: That passes.
            places: [m] (k, 3), in the order in which they are passed.
            lower: The corner of the volume allowed [m], −infinite where it is open.
            upper: The opposite one.
            duration: From the first place to the last [s], about.
        """
        low = np.maximum(places.min(axis=0) - AROUND, lower)
        high = np.minimum(places.max(axis=0) + AROUND, upper)
        return cls(pieces, body, low, high, places[[0, -1]], duration)

    @property
    def room(self) -> float:
        """The distance [m] from pieces at which the body has room, however it lies."""
        return self.body.revolved.reach + ROOM

    @cached_property
    def step(self) -> float:
        """The length of a cell's side [m], about."""
        return max(FINEST, float((np.prod(self.upper - self.lower) / CELLS) ** (1.0 / 3.0)))

    @cached_property
    def shape(self) -> tuple[int, int, int]:
        """The number of cells along each axis."""
        counts = [max(1, ceil(side / self.step)) for side in (self.upper - self.lower).tolist()]
        return counts[0], counts[1], counts[2]

    @cached_property
    def centres(self) -> Array:
        """The middle of all cells [m], (n, 3)."""
        axes = [
            low + (np.arange(count) + 0.5) * (high - low) / count
            for low, high, count in zip(self.lower, self.upper, self.shape, strict=True)
        ]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)

    def distances(self, points: Array, exact_within: float) -> Array:
        """Return the distances of points to the nearest piece, at least [m], when the body is there, (n,)."""
        before, after = np.linalg.norm(points - self.ends[:, None], axis=-1)
        times = self.duration * before / np.maximum(before + after, self.step)
        return self.pieces.distances(points, exact_within, times)

    @cached_property
    def clearance(self) -> Array:
        """The distance of all cells to the nearest piece, at least [m], (n,)."""
        return self.distances(self.centres, LOOKED_WITHIN)

    @cached_property
    def free(self) -> Mask:
        """The mask of the cells that a body may be in, (n,)."""
        return self.clearance > self.body.revolved.high

    @cached_property
    def cost(self) -> Array:
        """The cost of a metre through a cell, (n,)."""
        close = (self.room - self.clearance) / (self.room - self.body.revolved.high)
        return 1.0 + CLOSE * np.clip(close, 0.0, 1.0)

    def cell(self, points: Array) -> Indices:
        """The cells that points [m] (..., 3) lie in, or next to, (...)."""
        counts = np.array(self.shape)
        found = np.floor((points - self.lower) / (self.upper - self.lower) * counts).astype(np.intp)
        x, y, z = np.moveaxis(np.clip(found, 0, counts - 1), -1, 0)
        return np.asarray((x * counts[1] + y) * counts[2] + z)

    def nearest(self, place: Array) -> int:
        """The free cell that is nearest to a place [m] (3,)."""
        away = np.linalg.norm(self.centres - place, axis=1)
        return int(np.argmin(np.where(self.free, away, np.inf)))

    def way(self, begin: int, end: int, factor: Array) -> Indices | None:
        """The cells (k,) of the cheapest way between two, costs times a factor (n,); None: no way."""
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
        """Neighbours that are both free, and how far apart they are [m]."""
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
