"""Airspeed and specific thrust along a trajectory, from which all certified quantities are computed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.certification.enclosure import chebyshev
from aerobat.certification.enclosure.interpolation_error import InterpolationError, YawBounds, error_bounds
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.flatness.inverse_dynamics import UNDETERMINED, lateral_drag
from aerobat.kernels import flatness
from aerobat.trajectory import Trajectory, polynomial
from aerobat.trajectory.subintervals import Subintervals
from aerobat.vehicle import Vehicle

# [m/s^k] up to crackle; larger values are input errors, and their powers might overflow
MAX_DERIVATIVE = 1e30
MIN_DURATION = 1e-8  # [s] shorter pieces of a curve are not cut further


@dataclass(frozen=True)
class ThrustCurve:
    """Airspeed v and specific thrust f, f', f'' of a vehicle on a trajectory: four vector polynomials."""

    trajectory: Trajectory
    vehicle: Vehicle
    environment: Environment
    rates: Array  # velocity to snap in powers of normalised time, (S, K, 12)
    sums: Array  # sums of absolute values of the terms of v, f, f', f'', (S, 4)
    basis: chebyshev.Basis
    # yaw and two derivatives, in powers of normalised time, (S, any, 1); () without yaw
    yaw: tuple[Array, ...]

    @classmethod
    def of(
        cls, trajectory: Trajectory, vehicle: Vehicle, environment: Environment, degree: int = 20
    ) -> ThrustCurve:
        """Return the curve of a vehicle on a trajectory.

        Raise SpecError for unreasonably large derivatives.

        Args:
            trajectory: The path and its yaw; its heading does not matter here.
            vehicle: The vehicle with its drag.
            environment: Gravity and wind.
            degree: Smallest degree of interpolation; the polynomials' own degree if that is higher.
        """
        _check(trajectory)
        size = max(trajectory.degree, 1)
        rates = np.zeros((trajectory.segments, size, 4, 3))
        for k in range(4):
            rate = polynomial.differentiate(trajectory.coefficients, k + 1)
            rates[:, : rate.shape[1], k] = rate / trajectory.durations[:, None, None] ** (k + 1)
        velocity, acceleration, jerk, snap = np.linalg.norm(rates, axis=-1).sum(axis=1).T
        airspeed = velocity + np.linalg.norm(environment.wind)
        drag = lateral_drag(vehicle)
        thrust = flatness.specific_thrust(environment.gravity, drag, airspeed, acceleration, jerk, snap)
        sums = np.stack([airspeed, *thrust], axis=1)
        turned = () if trajectory.yaw is None else tuple(trajectory.yaw_polynomials(k) for k in range(3))
        basis = chebyshev.basis(max(degree, size, *(yaw.shape[1] for yaw in turned)))
        flat = rates.reshape(*rates.shape[:2], 12)
        return cls(trajectory, vehicle, environment, flat, sums, basis, turned)

    @property
    def floor(self) -> float:
        """The norm of f [m/s²] below which no attitude is determined."""
        return UNDETERMINED * self.environment.gravity

    def at(self, segment: NDArray[np.intp], s: Array) -> Array:
        """Return v, f, f', f'' at normalised times s (..., k) of segments (...), (..., k, 4, 3)."""
        rates = polynomial.evaluate(self.rates[segment][..., None, :, :], s)
        v, a, j, snap = np.moveaxis(rates.reshape(*s.shape, 4, 3), -2, 0)
        airspeed = v - self.environment.wind
        weight, drag = self.environment.weight, lateral_drag(self.vehicle)
        thrust = flatness.specific_thrust(weight, drag, airspeed, a, j, snap)
        return np.stack([airspeed, *thrust], axis=-2)

    def on(self, pieces: Subintervals) -> Array:
        """Return v, f, f', f'' at the basis's nodes on pieces of segments, (P, K + 1, 4, 3)."""
        return self.at(pieces.interval, pieces.positions(self.basis.nodes))

    def yaw_on(self, pieces: Subintervals) -> Array | None:
        """Return yaw and two derivatives at the basis's nodes, (P, K + 1, 3), or None without yaw."""
        s = pieces.positions(self.basis.nodes)
        found = [polynomial.evaluate(yaw[pieces.interval, None], s) for yaw in self.yaw]
        return np.concatenate(found, axis=-1) if found else None

    def yaw_bounds(self, pieces: Subintervals) -> YawBounds | None:
        """Return the magnitudes of the yaw's Chebyshev terms on pieces, or None without yaw."""
        values = self.yaw_on(pieces)
        if values is None:
            return None
        sums = np.stack([np.abs(yaw[pieces.interval, :, 0]).sum(axis=1) for yaw in self.yaw], axis=-1)
        return YawBounds(np.abs(self.basis.analysis @ values), chebyshev.EVALUATION_ROUNDING * sums)

    def series(self, values: Array) -> Array:
        """Return the Chebyshev series of v, f, f', f'' from their values `on` pieces, (P, K + 1, 4, 3)."""
        flat = self.basis.analysis @ values.reshape(*values.shape[:2], 12)
        flat[:, self.rates.shape[1] :] = 0.0  # polynomials of this degree have no further terms
        return np.asarray(flat.reshape(values.shape))

    def norms(self, series: Array, pieces: Subintervals) -> Array:
        """Return norms of the terms of `series`, all but the first enlarged by rounding, (P, K + 1, 4)."""
        norms = np.linalg.norm(series, axis=-1)
        padding = self.basis.lebesgue * chebyshev.EVALUATION_ROUNDING * self.sums[pieces.interval]
        norms[:, 1 : self.rates.shape[1]] += padding[:, None]
        return np.asarray(norms)

    def error_bounds(self, norms: Array, pieces: Subintervals) -> InterpolationError:
        """Bound the interpolation error on regular pieces, from the `norms` of their series."""
        seconds, sums = pieces.seconds(self.trajectory), self.sums[pieces.interval]
        return error_bounds(norms, seconds, sums, self.vehicle, self.yaw_bounds(pieces))


def _check(trajectory: Trajectory) -> None:
    with np.errstate(all="ignore"):
        for k in range(6):
            rates = polynomial.differentiate(trajectory.coefficients, k)
            if not (np.abs(rates / trajectory.durations[:, None, None] ** k) < MAX_DERIVATIVE).all():
                raise SpecError(
                    f"the trajectory's derivatives exceed {MAX_DERIVATIVE:g} m/s^k; "
                    "check the unit of its durations"
                )
