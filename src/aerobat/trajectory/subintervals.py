"""Repeatedly halved intervals: parts of segments or of sample intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.trajectory.piecewise import Trajectory

Rows = NDArray[np.bool_] | NDArray[np.intp] | slice


@dataclass(frozen=True)
class Subintervals:
    """Parts of numbered intervals in any order; the time of each interval runs from 0 to 1."""

    interval: NDArray[np.intp]  # (n,)
    start: Array  # in [0, 1), (n,)
    length: Array  # (n,)

    @classmethod
    def whole(cls, count: int) -> Subintervals:
        """Return `count` whole intervals."""
        return cls(np.arange(count), np.zeros(count), np.ones(count))

    @classmethod
    def joined(cls, collections: Sequence[Subintervals]) -> Subintervals:
        """Return all parts of several collections."""
        names = ("interval", "start", "length")
        return cls(*(np.concatenate([getattr(parts, name) for parts in collections]) for name in names))

    def __len__(self) -> int:
        return len(self.interval)

    def __getitem__(self, rows: Rows) -> Subintervals:
        return Subintervals(self.interval[rows], self.start[rows], self.length[rows])

    def halves(self) -> Subintervals:
        """Return both halves of every part: all first halves, then all second halves."""
        half = self.length / 2
        starts = (self.start, self.start + half)
        return Subintervals.joined([Subintervals(self.interval, start, half) for start in starts])

    def rest(self, count: int) -> Subintervals:
        """Return the remainder of `count` intervals without these parts, which must not overlap."""
        whole = Subintervals.whole(count)
        segment = np.concatenate([whole.interval, self.interval])
        start = np.concatenate([whole.start, self.start + self.length])
        end = np.concatenate([self.start, whole.length])
        start = start[np.lexsort((start, segment))]
        by_end = np.lexsort((end, np.concatenate([self.interval, whole.interval])))
        length = end[by_end] - start
        return Subintervals(np.sort(segment), start, length)[length > 0.0]

    def order(self) -> NDArray[np.intp]:
        """Return the row indices in the order of intervals and starts, (n,)."""
        return np.lexsort((self.start, self.interval))

    def in_order(self) -> Subintervals:
        """Return the parts in the order of intervals and starts."""
        return self[self.order()]

    def seconds(self, trajectory: Trajectory) -> Array:
        """Return the durations [s] of parts of a trajectory's segments, (n,)."""
        return np.asarray(self.length * trajectory.durations[self.interval])

    def spans(self, trajectory: Trajectory) -> tuple[Array, Array]:
        """Return the times [s] at which parts of a trajectory's segments begin and end, (n,) each."""
        return self.times(trajectory, np.array(-1.0)), self.times(trajectory, np.array(1.0))

    def positions(self, at: Array) -> Array:
        """Return positions (n,) in [-1, 1] on each part as times of its interval in [0, 1], (parts, n)."""
        return np.asarray(self.start[:, None] + self.length[:, None] * (1 + at) / 2)

    def times_at(self, trajectory: Trajectory, at: Array) -> Array:
        """Return the times [s] of positions (n,) in [-1, 1] on each part of segments, (parts, n)."""
        starts, durations = trajectory.knots[self.interval, None], trajectory.durations[self.interval, None]
        return np.asarray(starts + self.positions(at) * durations)

    def times(self, trajectory: Trajectory, position: Array) -> Array:
        """Return the times [s] of one position in [-1, 1] on each part of segments, (n,) -> (n,)."""
        s = self.start + self.length * (1 + position) / 2
        return np.asarray(trajectory.knots[self.interval] + s * trajectory.durations[self.interval])
