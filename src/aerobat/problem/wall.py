"""A wall around a gate's opening."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import Positive, declared
from aerobat.environment.obstacles.surface import beyond
from aerobat.problem.opening import OpeningShape

MIN_AREA = 1e-9  # [m²] smallest area of a part; smaller parts are dropped


@declared
class Wall:
    """A rectangular wall in a gate's plane, whose hole is the gate's opening."""

    border: Positive = 0.2  # [m] that it reaches beyond the opening, to all sides
    thickness: Positive = 0.05  # [m] half of it before the gate's plane, half behind

    def parts(self, opening: OpeningShape) -> Iterator[Array]:
        """Yield the corners [m] in the gate's plane of the part beyond each side of an opening, (k, 2)."""
        outline = opening.outline
        low, high = outline.min(axis=0) - self.border, outline.max(axis=0) + self.border
        whole = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
        for normal, distance in zip(*opening.sides, strict=True):
            part = beyond(whole, whole @ normal - distance)
            if _area(part) > MIN_AREA:
                yield part


def _area(corners: Array) -> float:
    """Return the area of a polygon [m²]."""
    following = np.roll(corners, -1, axis=0)
    return abs(float(np.sum(corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0]))) / 2.0
