"""Obstacles from occupancy grids and point clouds: occupied cells, merged into boxes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PlainValidator

from aerobat.arrays import Array
from aerobat.declaration import (
    FieldError,
    Label,
    Positive,
    Vector3,
    VectorLike,
    finite,
    positive,
    shown,
    validated,
    within_field,
)
from aerobat.documents import file_name
from aerobat.environment.obstacles.cloud_file import read_values
from aerobat.environment.obstacles.convex_piece import ConvexPiece
from aerobat.environment.obstacles.obstacle import Obstacle, obstacle
from aerobat.environment.obstacles.shapes import CORNERS

MAX_BOXES = 10_000  # limit of boxes; more take minutes to plan around
FARTHEST = 2**31  # largest distance from the origin, in cells


def _boxes(value: Any) -> Array:
    if not (hasattr(value, "__len__") and len(value)):
        raise FieldError("", f"must be one box or more, each six whole numbers, got {shown(value)}")
    boxes = finite(value, len(value), 6)
    whole = (boxes == np.round(boxes)).all() and (np.abs(boxes) <= FARTHEST).all()
    if not (whole and (boxes[:, :3] < boxes[:, 3:]).all()):
        raise FieldError("", "must be boxes of six whole numbers, each upper corner above its lower one")
    if len(boxes) > MAX_BOXES:
        raise FieldError("", f": {len(boxes)} boxes are more than {MAX_BOXES}; take a larger cell")
    return boxes


Boxes = Annotated[Array, PlainValidator(_boxes), Field(description="six whole numbers a box")]


def _numbers(values: Any) -> NDArray[Any]:
    """Return the values as an array. Raise FieldError for anything but numbers."""
    try:
        given = np.asarray(values)
    except ValueError:  # ragged
        given = np.asarray(None)
    if given.dtype.kind not in "biuf":
        raise FieldError("", f": a map holds numbers, or true and false, got {shown(values)}")
    return given


@validated
def occupied_boxes(
    values: Any, cell: Positive = 1.0, origin: VectorLike = (0.0, 0.0, 0.0)
) -> NDArray[np.int64]:
    """Return boxes that cover exactly the occupied cells of a grid, (n, 6).

    A box is x, y, z of its first cell, and of the cell after its last. Cells are merged along x, then along
    y, then along z.

    Args:
        values: An occupancy grid with three axes, occupied where it is not zero; or points [m], (n, 3), whose
            cells are occupied.
        cell: The edge of a cell [m]; only for points.
        origin: The lower corner of the cell 0, 0, 0 [m], (3,); only for points.
    """
    given = _numbers(values)
    if given.ndim == 3:
        cells = np.argwhere(given).astype(np.int64)
    elif given.ndim == 2 and given.shape[1] == 3:
        places = np.floor((given - np.asarray(origin, dtype=float)) / cell)
        if not (np.abs(places) <= FARTHEST).all():
            raise FieldError("", ": points of a map must be finite, and not far from its origin")
        cells = np.unique(places.astype(np.int64), axis=0)
    else:
        shape = " x ".join(map(str, given.shape))
        raise FieldError("", f": a map is a grid with three axes or points (n, 3), got {shape} numbers")
    boxes = np.concatenate([cells, cells + 1], axis=1)
    for axis in range(3):
        boxes = _merged(boxes, axis)
    return boxes


def _merged(boxes: NDArray[np.int64], axis: int) -> NDArray[np.int64]:
    """Return the boxes, merged where they touch along an axis and are equal otherwise."""
    others = [column for column in range(6) if column % 3 != axis]
    order = np.lexsort([boxes[:, axis], *boxes[:, others].T])
    boxes = boxes[order]
    alike = (boxes[1:, others] == boxes[:-1, others]).all(axis=1)
    joins = alike & (boxes[1:, axis] == boxes[:-1, axis + 3])
    first, last = np.append(True, ~joins)[: len(boxes)], np.append(~joins, True)[: len(boxes)]
    merged: NDArray[np.int64] = boxes[first]
    merged[:, axis + 3] = boxes[last, axis + 3]
    return merged


@obstacle("grid")
class Grid(Obstacle):
    """The occupied cells of a map: boxes of whole cells, from an occupancy grid or a point cloud.

    A problem's file names the map's file. Plans and runs store the boxes themselves.
    """

    boxes: Boxes  # x, y, z of each box's first cell, and of the cell after its last
    cell: Positive  # [m] the edge of a cell
    origin: Vector3 = field(default_factory=lambda: np.zeros(3))  # [m] the lower corner of the cell 0, 0, 0
    name: Label = "grid"  # by which findings name it

    SHORTHANDS: ClassVar[Mapping[str, str]] = {
        "file": "a .npy file of a grid with three axes, occupied where not zero, or a .npy or .ply file of "
        "points (n, 3) in m, from the problem's folder, instead of `boxes`",
    }

    @classmethod
    def expand(cls, table: dict[str, Any]) -> dict[str, Any]:
        """Replace the file by its boxes."""
        if "file" in table:
            if "boxes" in table:
                raise FieldError("file", "stands beside boxes; give one or the other")
            if "cell" not in table:
                raise FieldError("cell", "is missing; add it")
            cell = positive(table["cell"], "cell")
            with within_field("origin"):
                origin = finite(table.get("origin", (0.0, 0.0, 0.0)), 3)
            with within_field("file"):
                file = file_name(table.pop("file"))
                table["boxes"] = occupied_boxes(read_values(file), cell, origin)
                if not len(table["boxes"]):
                    raise FieldError("", f": {file} has no occupied cell; leave the obstacle out")
        elif "boxes" not in table:
            raise FieldError("file", "is missing; add it, or boxes")
        return table

    def abbreviate(self, table: dict[str, Any]) -> dict[str, Any]:
        """Convert the boxes to whole numbers."""
        return table | {"boxes": self.boxes.astype(int).tolist()}

    @property
    def pieces(self) -> tuple[ConvexPiece, ...]:
        """The boxes."""
        lower, upper = self.boxes[:, None, :3], self.boxes[:, None, 3:]
        corners = self.origin + self.cell * np.where(CORNERS > 0.0, upper, lower)
        return tuple(ConvexPiece(each, name=self.name) for each in corners)
