"""Flat shapes in the world, drawn far ones first (painter's algorithm) as one matplotlib collection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from aerobat.arrays import Array
from aerobat.reporting.scene.camera import Camera

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PolyCollection

Colour = str | tuple[str, float]  # a name, or a name and its opacity


@dataclass(frozen=True, eq=False)
class Shape:
    """A flat polygon, or a line when it has no face."""

    points: Array  # [m] world, (n, 3)
    face: Colour = "none"
    edge: Colour = "none"
    width: float = 0.0  # [pt] of the edge
    depth_bias: float = 0.0  # [m] toward the viewer, for the order of drawing only


def polyline(
    points: Array, edge: Colour, width: float, depth_bias: float = 0.0, piece: int = 4
) -> list[Shape]:
    """Return a line (T, 3) in short pieces, each of which can be behind or before other shapes."""
    starts = range(0, len(points) - 1, piece)
    return [Shape(points[k : k + piece + 1], edge=edge, width=width, depth_bias=depth_bias) for k in starts]


def draw_depth_sorted(
    axes: Axes, shapes: Sequence[Shape], camera: Camera, zorder: float = 2.0
) -> PolyCollection:
    """Draw shapes into axes whose data coordinates are the camera's picture [m]."""
    from matplotlib.collections import PolyCollection

    counts = np.array([len(shape.points) for shape in shapes])
    points = np.concatenate([shape.points for shape in shapes])
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    nearness = np.add.reduceat(camera.nearness(points), starts) / counts
    order = np.argsort(nearness + [shape.depth_bias for shape in shapes], kind="stable")
    outlines = np.split(camera.project(points), starts[1:])
    collection = PolyCollection(
        [outlines[k] for k in order],
        closed=False,
        facecolors=[shapes[k].face for k in order],
        edgecolors=[shapes[k].edge for k in order],
        linewidths=[shapes[k].width for k in order],
        capstyle="round",
        joinstyle="round",
        zorder=zorder,
    )
    axes.add_collection(collection, autolim=False)
    return collection
