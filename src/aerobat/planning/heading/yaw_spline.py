"""A yaw over time as quintics between knots, linear in its value and two derivatives at these."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import ceil

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.trajectory import Trajectory, polynomial
from aerobat.trajectory.subintervals import Subintervals

KNOT_STEP = 0.2  # [s] between knots, at most: yaw is slower than tilt
MOST = 150  # knots of a long path beside its own
PER_KNOT = 3  # variables: the yaw, its rate, and that rate's derivative
UNITS = np.eye(2 * PER_KNOT)
HERMITE = polynomial.hermite(UNITS[:, :PER_KNOT, None], UNITS[:, PER_KNOT:, None])[..., 0].T  # (6, 6)


@dataclass(frozen=True, eq=False)
class YawSpline:
    """The knots of a yaw, among which are those of its path."""

    path: Trajectory
    parts: Subintervals  # of the path's segments, in their order

    @classmethod
    def along(cls, path: Trajectory) -> YawSpline:
        """Cut long segments of a path."""
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

    @property
    def last_parts(self) -> NDArray[np.intp]:
        """The last part of each segment of the path, (S,)."""
        return np.flatnonzero(np.diff(self.parts.interval, append=-1))

    def with_yaw(self, variables: Array) -> Trajectory:
        """The path with the yaw of variables at all knots, (3 (n + 1),)."""
        path = self.cut_path
        yaw = (self._blocks @ self._own(variables))[..., 0]
        return Trajectory(path.durations, path.coefficients, path.heading, yaw)

    def times(self, s: Array) -> Array:
        """Times [s] of places (k,) from 0 to 1 on each part, (n k,)."""
        return np.asarray((self.cut_path.knots[:-1, None] + s * self.seconds[:, None]).ravel())

    def rows(self, s: Array, derivative: int) -> Array:
        """A derivative of the yaw at these times by all variables, (n k, 3 (n + 1))."""
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
        """From a part's own variables to its coefficients, (n, 6, 6)."""
        scale = np.tile((self.seconds[:, None] / KNOT_STEP) ** np.arange(PER_KNOT), 2)
        return np.asarray(HERMITE * scale[:, None])

    def _own(self, variables: Array) -> Array:
        """The variables of each part, (n, 6, 1)."""
        knots = variables.reshape(-1, PER_KNOT)
        return np.concatenate([knots[:-1], knots[1:]], axis=1)[..., None]
