"""A yaw over time as a quintic spline, linear in the yaw and its first two derivatives at the knots."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import ceil

import numpy as np

from aerobat.arrays import Array
from aerobat.trajectory import Trajectory, polynomial
from aerobat.trajectory.subintervals import Subintervals

KNOT_STEP = 0.2  # largest time between knots [s]: yaw is slower than tilt
MOST = 150  # number of knots at which KNOT_STEP grows for long paths
PER_KNOT = 3  # variables of a knot: the yaw and its first two derivatives
UNITS = np.eye(2 * PER_KNOT)
HERMITE = polynomial.hermite(UNITS[:, :PER_KNOT, None], UNITS[:, PER_KNOT:, None])[..., 0].T  # (6, 6)


@dataclass(frozen=True, eq=False)
class YawSpline:
    """The knots of a yaw, which include the knots of its path."""

    path: Trajectory
    parts: Subintervals  # parts of the path's segments, in order

    @classmethod
    def along(cls, path: Trajectory) -> YawSpline:
        """Return a yaw spline for a path, whose long segments are divided into parts."""
        step = max(KNOT_STEP, path.duration / MOST)
        counts = [ceil(seconds / step - 1e-9) for seconds in path.durations.tolist()]
        segment = np.repeat(np.arange(path.segments), counts)
        start = np.concatenate([np.arange(count) / count for count in counts])
        return cls(path, Subintervals(segment, start, 1.0 / np.repeat(counts, counts)))

    @cached_property
    def seconds(self) -> Array:
        """Durations of the parts [s], (n,)."""
        return self.parts.seconds(self.path)

    @cached_property
    def cut_path(self) -> Trajectory:
        """The same path, with a segment for each part."""
        whole = self.path.coefficients[self.parts.interval]
        coefficients = polynomial.restricted(whole, self.parts.start, self.parts.length)
        return Trajectory(self.seconds, coefficients, self.path.heading)

    def with_yaw(self, variables: Array) -> Trajectory:
        """Return the path with the yaw that variables (3 (n + 1),) at all knots give."""
        path, knots = self.cut_path, variables.reshape(-1, PER_KNOT)
        yaw = (self._blocks @ np.concatenate([knots[:-1], knots[1:]], axis=1)[..., None])[..., 0]
        return Trajectory(path.durations, path.coefficients, path.heading, yaw)

    def times(self, s: Array) -> Array:
        """Return the times [s], (n k,), of places (k,) from 0 to 1 on each part."""
        return np.asarray((self.cut_path.knots[:-1, None] + s * self.seconds[:, None]).ravel())

    def rows(self, s: Array, derivative: int) -> Array:
        """Return the matrix (n k, 3 (n + 1)) from all variables to a derivative of the yaw at these times."""
        count, width = len(self.seconds), 2 * PER_KNOT
        powers = polynomial.differentiate(np.eye(width)[:, :, None], derivative)[:, None]
        values = polynomial.evaluate(powers, s)[..., 0].T  # (k, 6) of the coefficients
        own = values @ self._blocks / self.seconds[:, None, None] ** derivative
        found = np.zeros((count, len(s), PER_KNOT * (count + 1)))
        columns = PER_KNOT * np.arange(count)[:, None] + np.arange(width)
        found[np.arange(count)[:, None, None], np.arange(len(s))[:, None], columns[:, None]] = own
        return found.reshape(count * len(s), -1)

    @cached_property
    def _blocks(self) -> Array:
        """The matrices from each part's variables to its coefficients, (n, 6, 6)."""
        scale = np.tile((self.seconds[:, None] / KNOT_STEP) ** np.arange(PER_KNOT), 2)
        return np.asarray(HERMITE * scale[:, None])
