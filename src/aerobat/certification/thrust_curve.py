"""Pieces of a trajectory, and the velocity and specific thrust along them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.certification.enclosure import chebyshev
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.flatness.reference import lateral_drag, specific_thrust
from aerobat.trajectory import Trajectory, polynomial
from aerobat.vehicle import Vehicle

MAX_DERIVATIVE = (
    1e30  # [m/s^k] a derivative, up to crackle, that cannot be meant and whose powers might overflow
)
Rows = NDArray[np.bool_] | NDArray[np.intp] | slice


@dataclass(frozen=True)
class Pieces:
    """Stretches of segments, in any order, in normalised time."""

    segment: NDArray[np.intp]  # (P,)
    start: Array  # in [0, 1), (P,)
    length: Array  # (P,)

    def __getitem__(self, rows: Rows) -> Pieces:
        return Pieces(self.segment[rows], self.start[rows], self.length[rows])

    def halves(self) -> Pieces:
        """Both halves of every piece."""
        half = self.length / 2
        return joined([Pieces(self.segment, self.start + side * half, half) for side in (0, 1)])

    def seconds(self, trajectory: Trajectory) -> Array:
        """How long they are [s], (P,)."""
        return np.asarray(self.length * trajectory.durations[self.segment])

    def times(self, trajectory: Trajectory, position: Array) -> Array:
        """The time [s] of positions in [-1, 1] on each piece, (P,) -> (P,)."""
        s = self.start + self.length * (1 + position) / 2
        return np.asarray(trajectory.knots[self.segment] + s * trajectory.durations[self.segment])


def joined(parts: list[Pieces]) -> Pieces:
    """All pieces of several collections."""
    names = ("segment", "start", "length")
    return Pieces(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


@dataclass(frozen=True)
class ThrustCurve:
    """Airspeed v and specific thrust f, f', f'' of a vehicle on a trajectory: four vector polynomials."""

    trajectory: Trajectory
    vehicle: Vehicle
    environment: Environment
    rates: Array  # velocity to snap in powers of normalised time, (S, K, 12)
    sums: Array  # sums of the absolute values of what v, f, f', f'' are summed from, (S, 4)
    basis: chebyshev.Basis

    @classmethod
    def of(
        cls, trajectory: Trajectory, vehicle: Vehicle, environment: Environment, degree: int
    ) -> ThrustCurve:
        """The motion, to be interpolated with a degree of at least `degree`. Raises SpecError if violent."""
        _check(trajectory)
        size = max(trajectory.degree, 1)
        rates = np.zeros((trajectory.segments, size, 4, 3))
        for k in range(4):
            rate = polynomial.differentiate(trajectory.coefficients, k + 1)
            rates[:, : rate.shape[1], k] = rate / trajectory.durations[:, None, None] ** (k + 1)
        velocity, acceleration, jerk, snap = np.linalg.norm(rates, axis=-1).sum(axis=1).T
        drag = lateral_drag(vehicle)
        airspeed = velocity + np.linalg.norm(environment.wind)
        sums = [
            airspeed,
            acceleration + environment.gravity + drag * airspeed,
            jerk + drag * acceleration,
            snap + drag * jerk,
        ]
        basis = chebyshev.basis(max(degree, size))
        flattened = rates.reshape(*rates.shape[:2], 12)
        return cls(trajectory, vehicle, environment, flattened, np.stack(sums, axis=1), basis)

    def at(self, segment: NDArray[np.intp], s: Array) -> Array:
        """v, f, f', f'' at normalised times s (..., k) of segments (...), (..., k, 4, 3)."""
        rates = polynomial.evaluate(self.rates[segment][..., None, :, :], s)
        v, a, j, snap = np.moveaxis(rates.reshape(*s.shape, 4, 3), -2, 0)
        airspeed = v - self.environment.wind
        thrust = specific_thrust(self.vehicle, self.environment, airspeed, a, j, snap)
        return np.concatenate([airspeed[..., None, :], thrust], axis=-2)

    def on(self, pieces: Pieces) -> Array:
        """v, f, f', f'' at the basis's nodes on pieces, (P, K + 1, 4, 3)."""
        s = pieces.start[:, None] + pieces.length[:, None] * (1 + self.basis.nodes) / 2
        return self.at(pieces.segment, s)

    def series(self, values: Array) -> Array:
        """Chebyshev series of v, f, f', f'' from `on`, in the order of their terms, (P, K + 1, 4, 3)."""
        flat = self.basis.analysis @ values.reshape(*values.shape[:2], 12)
        flat[:, self.rates.shape[1] :] = 0.0  # polynomials of this degree have no further terms
        return np.asarray(flat.reshape(values.shape))

    def norms(self, series: Array, pieces: Pieces) -> Array:
        """The sizes of the terms of `series`, all but the first padded outward by rounding, (P, K + 1, 4)."""
        norms = np.linalg.norm(series, axis=-1)
        padding = self.basis.lebesgue * chebyshev.ROUNDING * self.sums[pieces.segment]
        norms[:, 1 : self.rates.shape[1]] += padding[:, None]
        return np.asarray(norms)


def _check(trajectory: Trajectory) -> None:
    with np.errstate(all="ignore"):
        for k in range(6):
            rates = polynomial.differentiate(trajectory.coefficients, k)
            if not (np.abs(rates / trajectory.durations[:, None, None] ** k) < MAX_DERIVATIVE).all():
                raise SpecError(
                    f"the trajectory's derivatives exceed {MAX_DERIVATIVE:g} m/s^k; check the unit of its durations"
                )
