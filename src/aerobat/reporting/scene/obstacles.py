"""Glyphs of obstacles: their surfaces as glass, in cells small enough to be drawn by depth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from aerobat.arrays import Array
from aerobat.environment.obstacles import ConvexPiece
from aerobat.environment.obstacles.surface import Surface, beyond
from aerobat.environment.obstacles.visible_surfaces import surfaces_around
from aerobat.reporting.scene.camera import Camera
from aerobat.reporting.scene.glyphs import LIGHT
from aerobat.reporting.scene.shapes import Shape
from aerobat.reporting.style import FAINT, MUTED


def surfaces_beside(
    pieces: Sequence[ConvexPiece], points: Sequence[Array], times: Array | None = None
) -> tuple[tuple[Surface, ...], Array]:
    """Return the surfaces of obstacles around points, and all points that a picture must hold, (n, 3).

    Args:
        pieces: The convex pieces of the obstacles.
        points: Points of paths and gates [m], (n, 3) each.
        times: The times at which moving obstacles are drawn [s]; by default they keep their motion.
    """
    surfaces = surfaces_around(pieces, np.concatenate(points)) if pieces else ()
    if times is not None:
        still = [each for each in surfaces if each.motion is None]
        moving = [each for each in surfaces if each.motion is not None]
        surfaces = (*still, *(each.at(time) for time in times.tolist() for each in moving))
    return surfaces, np.concatenate([*points, *(surface.points for surface in surfaces)])


def obstacle_shapes(surfaces: Sequence[Surface], camera: Camera) -> list[Shape]:
    """Return the faces that are turned to the viewer, and all sharp edges."""
    if not surfaces:
        return []
    extent = np.ptp(np.concatenate([surface.points for surface in surfaces]), axis=0)
    cell = float(extent.max()) / 12  # each is wholly before or behind a path
    return [shape for surface in surfaces for shape in _surface_shapes(surface, camera, cell)]


def _surface_shapes(surface: Surface, camera: Camera, cell: float) -> Iterator[Shape]:
    for face in surface.faces:
        normal = np.cross(face[1] - face[0], face[2] - face[0])
        normal /= max(float(np.linalg.norm(normal)), 1e-12)
        if float(normal @ camera.toward) <= 0.0:
            continue
        light = max(float(normal @ LIGHT), 0.0)
        glass = MUTED, 0.42 + light * (0.12 - 0.42)  # less opaque toward the light
        for part in _cells(face, cell):
            yield Shape(part, face=glass)
    for edge in surface.edges:
        for part in _cells(edge, cell):
            yield Shape(part, edge=(FAINT, 0.45), width=0.7)


def _cells(corners: Array, cell: float) -> list[Array]:
    """Return the parts of a convex polygon, or of a line, in the cells [m] of a grid."""
    parts = [corners]
    for axis in range(3):
        parts = [cut for part in parts for cut in _slices(part, axis, cell)]
    return parts


def _slices(corners: Array, axis: int, cell: float) -> Iterator[Array]:
    """Yield the parts between levels of one coordinate, `cell` [m] apart."""
    low, high = corners[:, axis].min() / cell, corners[:, axis].max() / cell
    for level in np.arange(np.floor(low) + 1.0, np.ceil(high)) * cell:
        yield beyond(corners, level - corners[:, axis])
        corners = beyond(corners, corners[:, axis] - level)
    yield corners
