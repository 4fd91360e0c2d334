"""Trajectories for the Crazyflie's memory: pieces of degree 7 in x, y, z and yaw, float32.

A piece is what the firmware calls a poly4d, 132 bytes, little-endian: eight coefficients each of x, y, z
and yaw, rising powers of seconds since its start, then its duration. The memory of 4 kB holds 31. The same
numbers are a CSV in the layout of uav_trajectories, which Crazyswarm reads.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from aerobat.errors import SpecError
from aerobat.interchange.exports.heading import POWERS, fit_yaw
from aerobat.interchange.exports.loss import Content, Loss, peak_difference
from aerobat.interchange.exports.refit import DEGREE, refit
from aerobat.interchange.tables import csv_text
from aerobat.planning import Plan
from aerobat.simulation.outcome import length
from aerobat.trajectory import Trajectory

PIECE = np.dtype([("polynomials", "<f4", (4, POWERS)), ("duration", "<f4")])  # x, y, z, yaw
MEMORY = 4096  # bytes that the firmware has for trajectories
MAX_PIECES = MEMORY // PIECE.itemsize
MAX_ERROR = 2e-3  # [m] a fortieth of the vehicle's width: more is another path
MAX_EXTENT = 100.0  # [m] from the origin along each axis, where float32 has a resolution of 8 µm
PIECES = ("trajectory.bin", "trajectory.csv")
AXES = ("x", "y", "z", "yaw")
Pieces: TypeAlias = "np.ndarray[tuple[int], np.dtype[np.void]]"  # of the type PIECE


def crazyflie_pieces(plan: Plan, rate: float) -> Content:
    """Return the pieces as bytes and as CSV, see `fitted_pieces`; there are no rows, so `rate` is ignored."""
    pieces, loss = fitted_pieces(plan)
    header = ["duration", *(f"{axis}^{power}" for axis in AXES for power in range(POWERS))]
    rows = np.column_stack([pieces["duration"], pieces["polynomials"].reshape(len(pieces), -1)])
    return Content((pieces.tobytes(), csv_text([header, *rows.tolist()]).encode()), loss)


def fitted_pieces(plan: Plan) -> tuple[Pieces, Loss]:
    """Return the pieces of a plan, and the loss by the refit, by float32, and by headings that no yaw gives.

    Raises SpecError where 31 pieces do not follow the path, and where the path is too far from the origin.
    """
    fitted = refit(plan.trajectory, MAX_PIECES)
    farthest = float(np.abs(fitted.component_range(0)).max())
    if not farthest <= MAX_EXTENT:
        raise SpecError(
            f"a path for the Crazyflie keeps within {MAX_EXTENT:g} m of the origin along each axis, and this "
            f"one reaches {farthest:.4g} m; move it"
        )
    pieces = np.zeros(fitted.segments, dtype=PIECE)
    pieces["duration"] = fitted.durations
    powers = fitted.durations[:, None, None] ** np.arange(fitted.degree + 1)[:, None]
    pieces["polynomials"][:, :3, : fitted.degree + 1] = np.moveaxis(fitted.coefficients / powers, 1, 2)
    path = as_path(pieces)
    pieces["polynomials"][:, 3], attitude_error, thrust_axis_error = fit_yaw(plan, path)
    loss = Loss(
        position=peak_difference(plan.trajectory, 0, path),
        velocity=peak_difference(plan.trajectory, 1, path, 1),
        attitude=attitude_error,
        thrust_axis=thrust_axis_error,
        reading="pieces of float32 coefficients",
    )
    if loss.position > MAX_ERROR:
        raise SpecError(
            f"{MAX_PIECES} pieces of degree {DEGREE}, as many as the Crazyflie holds, miss the path by "
            f"{length(loss.position)}, {length(MAX_ERROR)} at most allowed; plan less at a time"
        )
    return pieces, loss


def as_path(pieces: Pieces, heading: float = 0.0) -> Trajectory:
    """Return the path of pieces of the type PIECE, as the vehicle flies it, with a constant heading [rad]."""
    durations = pieces["duration"].astype(float)
    powers = durations[:, None, None] ** np.arange(POWERS)[:, None]
    coefficients = np.moveaxis(pieces["polynomials"][:, :3].astype(float), 2, 1)
    return Trajectory(durations, coefficients * powers, heading)
