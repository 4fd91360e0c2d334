"""A path as few polynomials of degree 7, where a vehicle's memory holds no more.

Each piece has the path's position, velocity, acceleration and jerk at both of its ends, so that the pieces
join as smoothly as the path does there. From the start on they are made as long as an error allows, and the
error is the smallest with which they are few enough.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, sqrt

import numpy as np

from aerobat.arrays import Array
from aerobat.trajectory import Trajectory
from aerobat.trajectory.polynomial import differentiate, evaluate, hermite

DEGREE = 7
PLACES = 8  # times as many as pieces, at which pieces may end
SAMPLES = 4  # of the error from one such place to the next
SAME_WEIGHT = 500.0  # [1/s²] an acceleration that is off by 1 m/s² turns the thrust as little as 2 mm matter
FINEST = 1e-12  # of the error of one piece: no error is known to be less
HALVINGS = 12  # of the ratio between the bounds of the error, to a percent


def refit(trajectory: Trajectory, pieces: int) -> Trajectory:
    """The path as at most `pieces` polynomials of degree 7, itself where it is such already."""
    if trajectory.segments <= pieces and trajectory.degree <= DEGREE:
        return trajectory
    places = _Places.of(trajectory, pieces)
    ends = [len(places.times) - 1]
    high = places.error(ends)
    low = FINEST * high
    for _ in range(HALVINGS):
        middle = sqrt(low * high)
        tried = places.ends(middle, pieces)
        if len(tried) > pieces:
            low = middle
        else:
            high, ends = middle, tried
    starts = [0, *ends[:-1]]
    steps = [places.times[end] - places.times[start] for start, end in zip(starts, ends, strict=True)]
    fitted = [places.piece(start, end) for start, end in zip(starts, ends, strict=True)]
    return Trajectory(np.array(steps), np.array(fitted), trajectory.heading)


@dataclass(frozen=True, eq=False)
class _Places:
    """Where pieces may end, the path on both sides of these, and at samples between."""

    times: Array  # [s], (places,)
    later: Array  # [m/s^k] position to jerk as they go on from there, (places - 1, 4, 3)
    earlier: Array  # as they come to the next, (places - 1, 4, 3)
    inner: Array  # [s] samples from each place to the next, (places - 1, SAMPLES)
    position: Array  # [m] there, (places - 1, SAMPLES, 3)
    acceleration: Array  # [m/s²] there, (places - 1, SAMPLES, 3)

    @classmethod
    def of(cls, trajectory: Trajectory, pieces: int) -> _Places:
        """The knots, and as many equal parts of the segments between as it takes."""
        parts = ceil(PLACES * pieces / trajectory.segments)
        s = np.linspace(0.0, 1.0, parts + 1)
        sides = np.stack([trajectory.on_segments(s, k) for k in range(4)], axis=2)
        starts = (trajectory.knots[:-1, None] + s[:-1] * trajectory.durations[:, None]).ravel()
        times = np.append(starts, trajectory.duration)
        inner = times[:-1, None] + (np.arange(SAMPLES) + 0.5) / SAMPLES * np.diff(times)[:, None]
        return cls(
            times,
            sides[:, :-1].reshape(-1, 4, 3),
            sides[:, 1:].reshape(-1, 4, 3),
            inner,
            trajectory.evaluate(inner),
            trajectory.evaluate(inner, 2),
        )

    def ends(self, error: float, pieces: int) -> list[int]:
        """The places at which pieces end that are as long as the error allows, one place on at least.

        Where it takes more than `pieces`, the rest is left out.
        """
        found: list[int] = []
        start, last = 0, len(self.times) - 1
        while start < last and len(found) <= pieces:
            end = start + 1
            while end < last and self._piece_error(start, end + 1) <= error:
                end += 1
            found.append(end)
            start = end
        return found

    def error(self, ends: list[int]) -> float:
        """The largest error of these pieces."""
        starts = [0, *ends[:-1]]
        return max(self._piece_error(start, end) for start, end in zip(starts, ends, strict=True))

    def piece(self, start: int, end: int) -> Array:
        """Coefficients of the polynomial from one place to another, (8, 3)."""
        scale = (self.times[end] - self.times[start]) ** np.arange(4)[:, None]
        return hermite(scale * self.later[start], scale * self.earlier[end - 1])

    def _piece_error(self, start: int, end: int) -> float:
        """By how much a piece misses the path [m], or what an error of its acceleration weighs."""
        coefficients = self.piece(start, end)
        step = self.times[end] - self.times[start]
        s = (self.inner[start:end] - self.times[start]) / step
        off = evaluate(coefficients, s) - self.position[start:end]
        off_acceleration = (
            evaluate(differentiate(coefficients, 2), s) / step**2 - self.acceleration[start:end]
        )
        return float(max(np.abs(off).max(), np.abs(off_acceleration).max() / SAME_WEIGHT))
