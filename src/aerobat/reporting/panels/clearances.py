"""The clearance of the body from obstacles over time, as it is planned."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from aerobat.arrays import Array
from aerobat.environment.obstacles import Pieces
from aerobat.reporting.panels.poses import PoseHistory
from aerobat.reporting.panels.timelines import draw_series
from aerobat.reporting.style import FAINT, INK
from aerobat.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROWS = 200  # instants, at most, whose clearance is drawn
DEEPEST = -0.25  # [m] that an overlap is shown
NEAR, FAR = 0.5, 1e4  # [m] within which obstacles are looked for first, and at last


def draw_clearance(axes: Axes, poses: PoseHistory, vehicle: Vehicle, pieces: Pieces) -> None:
    """Draw the distance of the body from the nearest obstacle over time, below zero where they overlap."""
    rows = np.unique(np.linspace(0, len(poses.times) - 1, ROWS).round().astype(int))
    distances = clearances(poses.position[rows], poses.q_world_body[rows], vehicle, pieces)
    draw_series(axes, poses.times[rows], distances, INK)
    axes.axhline(0.0, color=FAINT, linewidth=0.8)
    lowest = max(1.1 * float(distances.min()), DEEPEST)
    axes.set(ylabel="clearance [m]", ylim=(min(0.0, lowest), None))


def clearances(position: Array, q_world_body: Array, vehicle: Vehicle, pieces: Pieces) -> Array:
    """Return the distances [m] of the body from the nearest of pieces, negative where they overlap, (T,).

    Args:
        position: Of the centre of mass [m], (T, 3).
        q_world_body: The attitudes, (T, 4).
        vehicle: Whose body it is.
        pieces: Of which there is one at least.
    """
    body = vehicle.bounding_ellipsoid
    offsets, shapes = body.turned(q_world_body)
    centres, reach = position + offsets, float(body.semi_axes.max())
    found, pending, within = np.full(len(position), np.inf), np.arange(len(position)), NEAR
    while len(pending) and within < FAR:
        bodies, numbers = pieces.near(centres[pending], reach, within)
        rows = pending[bodies]
        np.minimum.at(found, rows, pieces.separated(numbers, centres[rows], shapes[rows]).gaps)
        pending = pending[found[pending] > within]  # of others, none that is farther is nearer
        within *= 2.0
    return found
