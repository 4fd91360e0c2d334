"""The yaw with which a vehicle that derives its attitude from path and yaw gets the attitudes of a plan.

The Crazyflie, as other vehicles after Mellinger and Kumar (ICRA 2011), puts the body's z axis along the
thrust without drag, and its y axis along z × (cos ψ, sin ψ, 0). Where the thrust is horizontal, the attitude
does not depend on the yaw ψ. Where the thrust is along (cos ψ, sin ψ, 0), the attitude is undefined, and
beyond that direction it is turned round.
"""

from __future__ import annotations

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.interchange.exports.loss import attitudes, peak_angles
from aerobat.interchange.exports.refit import DEGREE
from aerobat.planning import Plan
from aerobat.trajectory import Trajectory

GRAVITY = 9.81  # [m/s²] of the Crazyflie's firmware
POWERS = DEGREE + 1
SAMPLES = 257  # of a piece
INITIAL_GUESSES = 64  # constant yaws, of which the best begins the fit
MAX_EVALUATIONS = 40  # of Levenberg-Marquardt; more gain nothing
MAX_SLOPE = 1e3  # of attitude over yaw; it is larger where the heading is along the thrust
REGULARIZATION = 1e-2  # [-] of coefficients, against a fit of rounding where attitude hardly depends on yaw
DEFINED = 1e-9  # [m/s²] of thrust, or sine of its angle to the heading, below which no attitude is defined


def fit_yaw(plan: Plan, path: Trajectory) -> tuple[Array, float, float]:
    """Return polynomials of yaw, one for each segment of the path, with attitudes nearest to the plan's.

    Their coefficients [rad/s^k], (pieces, POWERS), are rounded to float32. They come with the largest errors
    of the attitudes that follow from them [rad], with and without the heading.
    """
    s = np.linspace(0.0, 1.0, SAMPLES)
    instants = path.knots[:-1, None] + s * path.durations[:, None]
    planned = attitudes(plan, instants.ravel()).reshape(*instants.shape, 4)
    thrust = path.on_segments(s, 2) + GRAVITY * so3.UP
    z = thrust / np.maximum(np.linalg.norm(thrust, axis=-1, keepdims=True), DEFINED)
    powers = s[:, None] ** np.arange(POWERS)
    axes = so3.axes(planned)
    fitted = np.array([_fitted(*piece, powers) for piece in zip(z, axes, strict=True)])
    fitted[:, 0] -= 2.0 * np.pi * np.round((fitted[:, 0] - _ends_before(fitted)) / (2.0 * np.pi))
    in_seconds = path.durations[:, None] ** np.arange(POWERS)
    written = (fitted / in_seconds).astype(np.float32).astype(float)
    read = _attitude(z, (written * in_seconds) @ powers.T)
    return (written, *peak_angles(planned, read))


def _ends_before(fitted: Array) -> Array:
    """Return the yaw at the end of the piece before each piece, without the turns between, (pieces,)."""
    ends = fitted.sum(axis=1)
    whole_turns = 2.0 * np.pi * np.cumsum(np.round((ends[:-1] - fitted[1:, 0]) / (2.0 * np.pi)))
    return np.concatenate([[0.0], ends[:-1] + np.concatenate([[0.0], whole_turns[:-1]])])


def _fitted(z: Array, axes: Array, powers: Array) -> Array:
    """Return the coefficients of one piece in normalised time, (POWERS,).

    Args:
        z: Directions of the thrust, (samples, 3).
        axes: The planned body axes in the world, as columns, (samples, 3, 3).
        powers: The powers of normalised time, (samples, POWERS).
    """
    from scipy.optimize import least_squares  # takes a quarter of a second, and no other format needs it

    guesses = np.linspace(-np.pi, np.pi, INITIAL_GUESSES, endpoint=False)
    cost = (_turn(z, axes, np.broadcast_to(guesses[:, None], (INITIAL_GUESSES, len(z)))) ** 2).sum(axis=1)
    best = np.zeros(POWERS)
    best[0] = guesses[np.argmin(cost)]
    weights = np.full(POWERS, REGULARIZATION)
    weights[0] = 0.0  # constants are not penalised

    def residual(fit: Array) -> Array:
        return np.concatenate([_turn(z, axes, powers @ fit), weights * fit])

    def slopes(fit: Array) -> Array:
        return np.concatenate([_slope(z, powers @ fit)[:, None] * powers, np.diag(weights)])

    return np.asarray(least_squares(residual, best, slopes, method="lm", max_nfev=MAX_EVALUATIONS).x)


def _slope(z: Array, yaw: Array) -> Array:
    """Return the derivative of the turn about the thrust with respect to yaw [-], (samples,)."""
    across_sq = (_across(z, yaw) ** 2).sum(axis=-1)
    slopes = z[:, 2] / np.maximum(across_sq, DEFINED**2)
    return np.asarray(np.clip(slopes, -MAX_SLOPE, MAX_SLOPE))


def _turn(z: Array, axes: Array, yaw: Array) -> Array:
    """Return the turn about the thrust from planned axes to the attitude of a yaw [rad], (..., samples)."""
    y = _across(z, yaw)
    x_planned, y_planned = axes[..., 0], axes[..., 1]
    return np.asarray(np.arctan2(-(y * x_planned).sum(axis=-1), (y * y_planned).sum(axis=-1)))


def _across(z: Array, yaw: Array) -> Array:
    """Return the direction of the body's y axis, z × (cos ψ, sin ψ, 0), not normalised, (..., 3)."""
    heading = np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)], axis=-1)
    return so3.cross(z, heading)


def _attitude(z: Array, yaw: Array) -> Array:
    """Return the attitudes, body to world, of thrust directions and yaw, (..., 4)."""
    upright = so3.smallest_rotation(so3.UP, z)
    y = so3.unrotate(upright, _across(z, yaw))
    return so3.multiply(upright, so3.about_axis(so3.UP, np.arctan2(-y[..., 0], y[..., 1])))
