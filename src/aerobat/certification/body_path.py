"""A vehicle's body along a trajectory: its centre of mass and its thrust axis as Chebyshev series.

The body is the ellipsoid of revolution about the thrust axis that contains the vehicle at every angle about
that axis. Where no attitude is determined, the body is the ball that contains the vehicle in every attitude.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from aerobat.arrays import Array
from aerobat.certification.enclosure import chebyshev
from aerobat.certification.enclosure.queries import ChebyshevSeries
from aerobat.so3 import UP
from aerobat.trajectory import Trajectory, polynomial
from aerobat.trajectory.subintervals import Subintervals
from aerobat.vehicle.ellipsoid import Revolved

MAX_SAMPLE_STEP = 1e-3  # [s] largest interval between samples


@dataclass(frozen=True, eq=False)
class BodyPath:
    """A body on pieces of a trajectory."""

    trajectory: Trajectory
    body: Revolved
    pieces: Subintervals
    series: Array  # centre of mass [m] and thrust axis, world, (P, K + 1, 6)
    error: Array  # largest error of both series [m], [-], (P, 2)

    @property
    def balls(self) -> tuple[Array, Array]:
        """The balls that contain the body along each piece: centres [m], (P, 3), and radii [m], (P,)."""
        moved = np.linalg.norm(self.series[:, 1:, :3], axis=-1).sum(axis=1)
        return self.series[:, 0, :3], moved + self.error[:, 0] + self.body.reach

    def during(self, begin: float, end: float) -> BodyPath:
        """Return the part between two times [s]."""
        first, last = self.pieces.spans(self.trajectory)
        rows = np.flatnonzero((first < end) & (begin < last))
        pieces, duration = self.pieces[rows], (last - first)[rows]
        low, high = (np.clip((time - first[rows]) / duration, 0.0, 1.0) for time in (begin, end))
        series = chebyshev.basis(self.series.shape[1] - 1).parts(low, high) @ self.series[rows]
        cut = Subintervals(pieces.interval, pieces.start + low * pieces.length, (high - low) * pieces.length)
        return replace(self, pieces=cut, series=series, error=self.error[rows])

    @cached_property
    def sampled(self) -> tuple[Array, Array, Array]:
        """Instants [s] at most MAX_SAMPLE_STEP apart, (n,), with centres [m] and thrust axes, (n, 3) each."""
        count = np.ceil(self.pieces.seconds(self.trajectory) / MAX_SAMPLE_STEP).astype(np.intp)
        rows = np.repeat(np.arange(len(count)), count)
        along = (2 * (np.arange(len(rows)) - (np.cumsum(count) - count)[rows]) + 1) / count[rows] - 1
        values = [chebyshev.evaluate(series[rows], along) for series in np.moveaxis(self.series, -1, 0)]
        return self.pieces[rows].times(self.trajectory, along), np.array(values[:3]).T, np.array(values[3:]).T

    @classmethod
    def in_attitude(cls, found: ChebyshevSeries, body: Revolved) -> BodyPath:
        """Return the body in the attitude given by the thrust direction.

        Args:
            found: Series whose last three columns are the components of the thrust axis.
            body: The vehicle's body.
        """
        centre, off = _centre(found.trajectory, found.pieces, found.series.shape[1] - 1)
        series = np.concatenate([centre, found.series[..., -3:]], axis=-1)
        error = np.stack([off, np.linalg.norm(found.error[:, -3:], axis=1)], axis=1)
        return cls(found.trajectory, body, found.pieces, series, error)

    @classmethod
    def in_every_attitude(cls, trajectory: Trajectory, pieces: Subintervals, body: Revolved) -> BodyPath:
        """Return the ball around the body, for all attitudes."""
        centre, off = _centre(trajectory, pieces, max(trajectory.degree, 1))
        axis = np.zeros_like(centre)
        axis[:, 0] = UP
        series, error = np.concatenate([centre, axis], axis=-1), np.stack([off, np.zeros_like(off)], axis=1)
        return cls(trajectory, Revolved(body.reach, body.reach, 0.0, 0.0), pieces, series, error)


def _centre(trajectory: Trajectory, pieces: Subintervals, degree: int) -> tuple[Array, Array]:
    """Return the series of the position [m], (P, K + 1, 3), and its rounding error [m], (P,)."""
    basis = chebyshev.basis(degree)
    coefficients = trajectory.coefficients[pieces.interval]
    summed = np.linalg.norm(np.abs(coefficients).sum(axis=1), axis=-1)
    series = basis.analysis @ polynomial.evaluate(coefficients[:, None], pieces.positions(basis.nodes))
    series[:, trajectory.coefficients.shape[1] :] = 0.0  # polynomials of this degree have no further terms
    return series, basis.lebesgue * chebyshev.EVALUATION_ROUNDING * summed
