"""A path as a few polynomials of degree 7, for vehicles whose memory holds no more.

Each piece has the path's position, velocity, acceleration and jerk at both of its ends, so that the pieces
join as smoothly as the path does there. From the start on, each piece is as long as an error allows.
Bisection finds the smallest error with few enough pieces.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import ceil, sqrt

import numpy as np

from aerobat.arrays import Array
from aerobat.trajectory import Trajectory
from aerobat.trajectory.polynomial import differentiate, evaluate, hermite

DEGREE = 7
PLACES = 8  # number of places where pieces may end, as a multiple of the number of pieces
SAMPLES = 4  # samples of the error between two such places


def refit(trajectory: Trajectory, pieces: int) -> Trajectory:
    """Return the path as at most `pieces` polynomials of degree 7; a path of such pieces is unchanged."""
    if trajectory.segments <= pieces and trajectory.degree <= DEGREE:
        return trajectory
    places = _Places.of(trajectory, pieces)
    ends = [len(places.times) - 1]
    high = places.error(ends)
    low = 1e-12 * high
    for _ in range(12):  # halvings of the ratio between both errors, to a percent
        middle = sqrt(low * high)
        tried = places.ends(middle, pieces)
        if len(tried) > pieces:
            low = middle
        else:
            high, ends = middle, tried
    fitted = [places.piece(start, end) for start, end in pairwise([0, *ends])]
    return Trajectory(np.diff(places.times[[0, *ends]]), np.array(fitted), trajectory.heading)


@dataclass(frozen=True, eq=False)
class _Places:
    """The places where pieces may end, with the path on both sides of each, and at samples between them."""

    times: Array  # [s], (places,)
    later: Array  # [m/s^k] position to jerk just after each place but the last, (places - 1, 4, 3)
    earlier: Array  # [m/s^k] position to jerk just before each place but the first, (places - 1, 4, 3)
    inner: Array  # [s] samples between each place and the next, (places - 1, SAMPLES)
    position: Array  # [m] at the samples, (places - 1, SAMPLES, 3)
    acceleration: Array  # [m/s²] at the samples, (places - 1, SAMPLES, 3)

    @classmethod
    def of(cls, trajectory: Trajectory, pieces: int) -> _Places:
        """Return the places at the knots and, at equal intervals, between them."""
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
        """Return the places where pieces end if each is as long as the error allows.

        Stops after more than `pieces`.
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
        """Return the largest error of pieces that end at these places."""
        return max(self._piece_error(start, end) for start, end in pairwise([0, *ends]))

    def piece(self, start: int, end: int) -> Array:
        """Return the coefficients of the polynomial from one place to another, (8, 3)."""
        scale = (self.times[end] - self.times[start]) ** np.arange(4)[:, None]
        return hermite(scale * self.later[start], scale * self.earlier[end - 1])

    def _piece_error(self, start: int, end: int) -> float:
        """Return the error of a piece [m]; an acceleration error of 1 m/s² counts as 2 mm.

        Both turn the thrust about as much.
        """
        coefficients = self.piece(start, end)
        step = self.times[end] - self.times[start]
        s = (self.inner[start:end] - self.times[start]) / step
        off = evaluate(coefficients, s) - self.position[start:end]
        off_acceleration = (
            evaluate(differentiate(coefficients, 2), s) / step**2 - self.acceleration[start:end]
        )
        return float(max(np.abs(off).max(), np.abs(off_acceleration).max() / 500.0))
