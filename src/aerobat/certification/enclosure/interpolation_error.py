"""Error of flatness quantities interpolated at Chebyshev points, proven by complex analysis.

Velocity and specific thrust f are polynomials on a piece of a segment, so all flatness quantities are
analytic in complex time wherever f·f is not zero. Let q be analytic inside the Bernstein ellipse E_ρ around
the piece, with |q| <= B there. Its interpolant p of degree K satisfies |q − p| <= 4 B ρ⁻ᴷ/(ρ − 1) on the
piece (Trefethen, Approximation Theory and Approximation Practice, theorem 8.2). Bounds B follow from the
norms of the terms of v, f, f', f'' alone. With c = |c_0| of f, |f − c_0| <= Δ = δ c on E_ρ and n² = f·f,

    δ < 1/2   =>   Re n >= c (1 − δ).

DERIVATION.md derives the other bounds; complex vectors have their Hermitian norms. For ρ = 1, the piece
itself, the same bounds give the magnitudes of the quantities and of their rounding errors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.certification import quantities
from aerobat.certification.enclosure.chebyshev import EVALUATION_ROUNDING, growth, tails
from aerobat.certification.quantities import MagnitudeBounds
from aerobat.flatness.inverse_dynamics import axial_drag
from aerobat.vehicle import Vehicle

MAX_REMAINDER = 1e-8  # largest interpolation error of a quantity, relative to its scale
MAX_COMMAND_REMAINDER = 1e-7  # relative error of a command, which contains the interpolant's derivative
RHO = np.array([1.0, 1.6, 2.0, 2.5, 3.2, 4.0, 5.5, 8.0, 14.0, 30.0, 80.0])
MAX_FRAME_ANGLE = 30.0  # imaginary angle of the frame from which on an ellipse is not used


@dataclass(frozen=True)
class InterpolationError:
    """Error bounds on each of P pieces, for each of Q quantities."""

    magnitude: Array  # largest magnitude of the quantities, (P, Q)
    remainder: Array  # largest distance between a quantity and its interpolant, without rounding, (P, Q)
    rounding: Array  # largest rounding error of a quantity's values, (P, Q)
    twist_remainder: Array  # [rad] `remainder` of the frame's rotation angle along the piece, (P,)
    twist_rounding: Array  # [rad] `rounding` of that angle, and of the transition between pieces, (P,)
    per_radian: Array  # change of a quantity per error of the frame's angle [1/rad], (P, Q)
    rate_remainder: Array  # `remainder` of time derivatives [1/s], (P, Q)
    # change of time derivatives per constant error of the frame's angle [1/(rad s)], (P, Q)
    rate_per_radian: Array


@dataclass(frozen=True)
class EllipseBounds:
    """Bounds on R ellipses around P pieces, all (P, R)."""

    regular: NDArray[np.bool_]  # False where the other bounds are invalid
    root: Array  # lower bound of Re n, the norm of the thrust [m/s²]
    magnitudes: MagnitudeBounds
    twist: Array  # the angle by which the frame rotates about b3 per half length [rad]
    curl: Array  # the imaginary part of that angle [rad]


@dataclass(frozen=True)
class YawBounds:
    """The yaw relative to a frame without spin, with two time derivatives, along P pieces."""

    terms: Array  # magnitudes of their Chebyshev coefficients, (P, K + 1, 3)
    rounding: Array  # largest rounding error of their values, (P, 3)

    @property
    def on_ellipses(self) -> Array:
        """Bounds of the imaginary part of the yaw, and of both derivatives, (P, R, 3)."""
        terms = self.terms + self.rounding[:, None]
        larger = growth(terms.shape[1] - 1, RHO)
        return np.stack([terms[..., 0] @ np.sqrt(larger**2 - 1), *(terms.T[1:].swapaxes(1, 2) @ larger)], -1)


def regular(norms: Array) -> NDArray[np.bool_]:
    """Tell on which pieces the smallest ellipse contains no zero of f·f; norms as from `ThrustCurve`."""
    thrust = norms[..., 1]
    return _off_zero(thrust[:, 0], thrust[:, 1:] @ growth(thrust.shape[1] - 1, RHO[1:2])[1:, 0])


def error_bounds(
    norms: Array, seconds: Array, sums: Array, vehicle: Vehicle, yaw: YawBounds | None = None
) -> InterpolationError:
    """Bound the interpolation error on regular pieces.

    Args:
        norms: Norms of the terms of v, f, f', f'' as Chebyshev series, (P, K + 1, 4).
        seconds: Durations of the pieces [s], (P,).
        sums: Sums of the absolute values of the terms of v, f, f', f'', (P, 4).
        vehicle: The vehicle.
        yaw: Its yaw relative to the frame without spin, or None.
    """
    around = on_ellipses(norms, seconds / 2, vehicle, yaw)
    real = MagnitudeBounds(*(bound[:, 0] for bound in vars(around.magnitudes).values()))
    min_thrust = norms[:, 0, 1] - norms[:, 1:, 1].sum(axis=1)
    speed = norms[..., 0].sum(axis=1)
    rounded = first_order(real, min_thrust, speed, EVALUATION_ROUNDING * sums, vehicle)
    if yaw is not None:
        off, rate, acceleration = yaw.rounding.T
        omega = rounded.omega + off * real.omega + rate
        omega_dot = rounded.omega_dot + off * real.omega_dot + acceleration
        omega_dot += yaw.on_ellipses[:, 0, 1] * rounded.omega + rate * real.omega
        rounded = replace(rounded, omega=omega, omega_dot=omega_dot)
    decay, rate_decay = tails(norms.shape[1] - 1, RHO[1:])
    bounds = np.where(around.regular[..., None], quantities.bounds(vehicle, around.magnitudes), np.inf)
    twist = np.where(around.regular, around.twist, np.inf)
    none = np.zeros_like(around.twist)
    turned = MagnitudeBounds(none, none, around.magnitudes.omega, around.magnitudes.omega_dot)
    per_radian = quantities.errors(vehicle, around.magnitudes, turned)
    per_radian[:, 1:][~around.regular[:, 1:]] = np.inf
    away = (RHO[1:] + 1 / RHO[1:]) / 2 - 1  # distance of an ellipse from the piece, for Cauchy's inequality
    per_second = 2 / seconds[:, None]
    return InterpolationError(
        magnitude=bounds[:, 0],
        remainder=(bounds[:, 1:] * decay[:, None]).min(axis=1),
        rounding=quantities.errors(vehicle, real, rounded),
        twist_remainder=2 * (twist[:, 1:] * decay).min(axis=1),
        twist_rounding=seconds * rounded.omega + EVALUATION_ROUNDING,
        per_radian=per_radian[:, 0],
        rate_remainder=per_second * (bounds[:, 1:] * rate_decay[:, None]).min(axis=1),
        rate_per_radian=per_second * (per_radian[:, 1:] / away[:, None]).min(axis=1),
    )


def on_ellipses(norms: Array, half: Array, vehicle: Vehicle, yaw: YawBounds | None = None) -> EllipseBounds:
    """Return bounds from the norms (P, K + 1, 4) of the terms of v, f, f', f''.

    `half` (P,) is half the duration of the pieces [s].
    """
    larger = growth(norms.shape[1] - 1, RHO)
    speed, _, jerk, snap = (norms[..., k] @ larger for k in range(4))
    mean = norms[:, :1, 1]
    away = norms[:, 1:, 1] @ larger[1:]
    usable = _off_zero(mean, away)
    away, speed, jerk, snap = (np.where(usable, bound, 0.0) for bound in (away, speed, jerk, snap))
    root = mean - away  # lower bound of Re n; |n + w| is at least twice as large
    ratio = (mean + away) / root  # upper bound of |f|/|n|
    twist = half[:, None] * away * jerk / (2 * root**2)
    curl = twist * (RHO + 1 / RHO) / 2  # imaginary part of the angle, accumulated from the real line
    if yaw is not None:
        turned, rate, acceleration = np.moveaxis(yaw.on_ellipses, -1, 0)
        curl = curl + turned
    usable &= curl < MAX_FRAME_ANGLE
    frame = (1 + away * mean / root**2) * np.exp(np.where(usable, curl, 0.0))  # upper bound of |x|, |y|
    omega = frame * jerk / root
    omega_dot = frame * (snap + 2 * ratio * jerk**2 / root) / root
    if yaw is not None:
        omega_dot = np.hypot(omega_dot + rate * omega, acceleration)
        omega = np.hypot(omega, rate)
    grown = away * (2 * mean + away) / (mean + root)  # upper bound of |n − c|
    axial = abs(axial_drag(vehicle))
    thrust = vehicle.mass * (np.where(RHO > 1, grown, mean + away) + axial * ratio * speed)
    return EllipseBounds(usable, root, MagnitudeBounds(thrust, ratio, omega, omega_dot), twist, curl)


def _off_zero(mean: Array, away: Array) -> NDArray[np.bool_]:
    """Tell where δ < 1/2, with a margin of 0.1 %."""
    return np.asarray(2 * away < 0.999 * mean)


def first_order(
    real: MagnitudeBounds, min_thrust: Array, speed: Array, off: Array, vehicle: Vehicle
) -> MagnitudeBounds:
    """Return first-order errors of flatness quantities for errors `off` of v, f, f', f''.

    Args:
        real: Bounds of the flatness quantities, (P,) each.
        min_thrust: Lower bound of |f| [m/s²], (P,).
        speed: Upper bound of |v| [m/s], (P,).
        off: Errors of v, f, f', f'', (P, 4).
        vehicle: The vehicle.
    """
    f, df, ddf = (off[:, 1:] / min_thrust[:, None]).T
    return MagnitudeBounds(
        thrust=vehicle.mass * (off[:, 1] + abs(axial_drag(vehicle)) * (off[:, 0] + 2 * f * speed)),
        cos_tilt=2 * f,
        omega=df + 2 * f * real.omega,
        omega_dot=ddf + 4 * df * real.omega + 2 * f * (real.omega_dot + 4 * real.omega**2),
    )
