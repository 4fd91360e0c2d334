"""Several paths in one picture, each in its colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from aerobat.arrays import Array
from aerobat.environment.obstacles import ConvexPiece
from aerobat.problem.gate import Gate
from aerobat.reporting.page import size_of
from aerobat.reporting.panels.keyframes import plane_of
from aerobat.reporting.panels.path import mark_ends
from aerobat.reporting.scene.axes_box import box_around, draw_axes_box, room_for_box
from aerobat.reporting.scene.camera import best_view
from aerobat.reporting.scene.glyphs import gate_corners, gate_shapes
from aerobat.reporting.scene.obstacles import obstacle_shapes, surfaces_beside
from aerobat.reporting.scene.shapes import draw_depth_sorted

if TYPE_CHECKING:
    from matplotlib.axes import Axes

AROUND = 0.25  # [in] free around paths that lie in a plane


@dataclass(frozen=True, eq=False)
class NamedPath:
    """A path with what tells it from others."""

    name: str
    colour: str
    position: Array  # [m], (T, 3), as many as of the others


def draw_overlay(
    axes: Axes, paths: Sequence[NamedPath], gates: Sequence[Gate], pieces: Sequence[ConvexPiece] = ()
) -> None:
    """Draw paths from one start to one goal: in the vertical plane that holds them, or in space.

    Args:
        axes: Where to draw.
        paths: In their colours.
        gates: All gates of the problem.
        pieces: Of obstacles, which are drawn where they are near.
    """
    surfaces, points = surfaces_beside(pieces, [*(path.position for path in paths), gate_corners(gates)])
    plane = plane_of(points)
    if plane is None:
        box = box_around(points, 0.02 * float(np.ptp(points, axis=0).max()))
        camera = best_view(points, gates, box.corners, room_for_box(size_of(axes)))
        draw_axes_box(axes, box, camera)
    else:
        camera = plane.camera
        _fit_plane(axes, camera.project(points))
        axes.set(xlabel=plane.label, ylabel="z [m]")
    shapes = obstacle_shapes(surfaces, camera) + [shape for gate in gates for shape in gate_shapes(gate)]
    if shapes:
        draw_depth_sorted(axes, shapes, camera, zorder=1.5)
    pictures = [camera.project(path.position) for path in paths]
    for path, picture in zip(paths, pictures, strict=True):
        axes.plot(*picture.T, color=path.colour, linewidth=1.7, label=path.name)
    mark_ends(axes, pictures[0][[0, -1]])


def _fit_plane(axes: Axes, picture: Array) -> None:
    """Fit points (n, 2) [m] into the axes, the same scale along both."""
    low, high = picture.min(axis=0), picture.max(axis=0)
    size = size_of(axes)
    per_inch = max(float(((high - low) / (size - 2 * AROUND)).max()), 1e-3)
    (left, bottom), (right, top) = ((low + high + sign * size * per_inch) / 2 for sign in (-1.0, 1.0))
    axes.set(xlim=(left, right), ylim=(bottom, top))
