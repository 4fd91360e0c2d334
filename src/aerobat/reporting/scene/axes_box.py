"""The axes box around a scene: floor, two back walls, and scales along its edges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from aerobat.arrays import Array, round_step
from aerobat.problem.gate import Gate
from aerobat.reporting.page import set_scale, size_of
from aerobat.reporting.scene.camera import Camera, best_view
from aerobat.reporting.scene.shapes import Shape, draw_depth_sorted
from aerobat.reporting.style import HAIR, NORMAL, PAPER, SMALL

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# [in] margins for the scales: left of a box and below it, right of it and above it
BOX_MARGINS = np.array([[0.5, 0.5], [0.3, 0.2]])
NUMBERS = 0.15  # [in] from an edge to the numbers along it


@dataclass(frozen=True, eq=False)
class AxesBox:
    """An upright box around everything in a scene."""

    lower: Array  # [m], (3,)
    upper: Array  # [m], (3,)

    @property
    def corners(self) -> Array:
        """All eight corners [m], (8, 3)."""
        grid = np.meshgrid(*np.stack([self.lower, self.upper], axis=1), indexing="ij")
        return np.stack(grid, axis=-1).reshape(-1, 3)

    def ticks(self, axis: int) -> Array:
        """Return round numbers along an axis [m], as dense as on the longest, or denser so that two fit."""
        lengths = self.upper - self.lower
        step = min(round_step(lengths.max() / 5.0), round_step(lengths[axis] / 2.5))
        first = np.ceil(self.lower[axis] / step - 1e-9)
        last = np.floor(self.upper[axis] / step + 1e-9)
        return np.arange(first, last + 1) * step + 0.0  # no minus zero

    def front(self, camera: Camera) -> Array:
        """Return the coordinates of the sides that face the viewer [m], (3,)."""
        return np.where(camera.toward > 0, self.upper, self.lower)

    def back(self, camera: Camera) -> Array:
        """Return the coordinates of the sides behind the scene [m], (3,)."""
        return np.where(camera.toward > 0, self.lower, self.upper)


def draw_box_around(
    axes: Axes, points: Array, pad: float, path: Array, gates: Sequence[Gate]
) -> tuple[AxesBox, Camera]:
    """Draw the axes box around points, in the best view of a path and gates; return box and camera.

    Args:
        axes: The axes.
        points: Points that the box holds [m], (n, 3).
        pad: The distance from the points to the sides [m].
        path: Positions [m], (T, 3).
        gates: The gates, of which the openings are to be seen.
    """
    box = box_around(points, pad)
    camera = best_view(path, gates, box.corners, _room(axes))
    draw_axes_box(axes, box, camera)
    return box, camera


def box_around(points: Array, pad: float) -> AxesBox:
    """Return the box around points (n, 3), `pad` [m] wider, with no side much shorter than the longest."""
    lower, upper = points.min(axis=0) - pad, points.max(axis=0) + pad
    least = np.array([0.22, 0.22, 0.12]) * (upper - lower).max()
    short = np.maximum(least - (upper - lower), 0.0)
    fraction = np.array([0.5, 0.5, 0.0])  # the floor stays right below
    return AxesBox(lower - fraction * short, upper + (1.0 - fraction) * short)


def draw_axes_box(axes: Axes, box: AxesBox, camera: Camera) -> None:
    """Draw floor, walls and scales, and fit the axes to them with their aspect kept."""
    per_metre = _fit(axes, box, camera)
    draw_depth_sorted(axes, _walls(box, camera), camera, zorder=1.0)
    for axis in range(3):
        _scale(axes, box, camera, axis, per_metre)


def _room(axes: Axes) -> Array:
    """Return the width and height [in] that the scales leave to a box in axes, (2,)."""
    return np.asarray(size_of(axes) - BOX_MARGINS.sum(axis=0))


def _fit(axes: Axes, box: AxesBox, camera: Camera) -> float:
    """Centre the box in the room that its scales leave, and return the scale [in/m]."""
    picture = camera.project(box.corners)
    low, high = picture.min(axis=0), picture.max(axis=0)
    per_metre = float((_room(axes) / (high - low)).min())
    centre = (low + high) / 2 + (BOX_MARGINS[1] - BOX_MARGINS[0]) / 2 / per_metre
    set_scale(axes, centre, 1.0 / per_metre)
    axes.set_axis_off()
    return per_metre


def _walls(box: AxesBox, camera: Camera) -> list[Shape]:
    """Return the floor and the back walls with the lines of their grids."""
    back = box.back(camera)
    back[2] = box.lower[2]
    shapes, lines = [], []
    for normal in range(3):
        first, second = (axis for axis in range(3) if axis != normal)
        corners = np.full((4, 3), back[normal])
        corners[:, first] = np.array([box.lower, box.upper, box.upper, box.lower])[:, first]
        corners[:, second] = np.array([box.lower, box.lower, box.upper, box.upper])[:, second]
        shapes.append(Shape(corners, face=PAPER if normal == 2 else "#fbfcfd"))
        for along, across in ((first, second), (second, first)):
            for tick in box.ticks(across):
                ends = np.tile(back, (2, 1))
                ends[:, along] = box.lower[along], box.upper[along]
                ends[:, across] = tick
                lines.append(Shape(ends, edge=HAIR, width=0.7, depth_bias=1e3))
    return shapes + lines


def _scale(axes: Axes, box: AxesBox, camera: Camera, axis: int, per_metre: float) -> None:
    """Write numbers and the name of an axis along one edge of the box."""
    edge, outward = _edge(box, camera, axis)
    ticks = box.ticks(axis)
    points = np.tile(edge, (len(ticks), 1))
    points[:, axis] = ticks
    places = camera.project(points)
    if len(ticks) > 1:
        pitch = max(float(np.linalg.norm(places[1] - places[0])) * per_metre, 1e-6)  # an axis seen end-on
        keep = slice(None, None, max(1, int(np.ceil(0.26 / pitch))))  # [in] between numbers
        places, ticks = places[keep], ticks[keep]
    numbers = [f"{tick:g}".replace("-", "−") for tick in ticks]
    for place, number in zip(places + NUMBERS * outward / per_metre, numbers, strict=True):
        axes.text(place[0], place[1], number, size=SMALL, ha="center", va="center")
    if axis == 2:
        edge[axis] = box.upper[axis]
        place = camera.project(edge) + np.array([-NUMBERS, NUMBERS]) / per_metre
    else:
        edge[axis] = (box.lower[axis] + box.upper[axis]) / 2
        half_width = 0.5 * 0.07 * max(map(len, numbers), default=0)  # [in] of the longest number
        beside = max(0.3, 0.2 + half_width)  # [in] from the middle of the numbers
        place = camera.project(edge) + (NUMBERS + np.array([beside, 0.2])) * outward / per_metre
    axes.text(place[0], place[1], f"{'xyz'[axis]} [m]", size=NORMAL, ha="center", va="center")


def _edge(box: AxesBox, camera: Camera, axis: int) -> tuple[Array, Array]:
    """Return a point of the edge with the scale of an axis (3,), and the outward direction there (2,)."""
    edge = box.front(camera)
    edge[2] = box.lower[2]
    if axis == 2:  # the leftmost of the upright edges
        leftmost = min(box.corners, key=lambda corner: float(camera.project(corner)[0]))
        return leftmost.copy(), np.array([-1.0, 0.0])
    other = 1 - axis
    inward = np.zeros(3)
    inward[other] = np.sign(camera.toward[other])
    outward = camera.project(inward)
    return edge, outward / max(float(np.linalg.norm(outward)), 1e-9)
