"""A ball: a place to meet within a radius."""

from __future__ import annotations

from math import sqrt

import numpy as np

from aerobat.declaration import Positive, Vector3, declared
from aerobat.problem.condition import Condition, within

GOLDEN_RATIO = (1.0 + sqrt(5.0)) / 2.0
# normals of the six pairs of faces of a regular dodecahedron, which are corners of an icosahedron, (6, 3)
FACES = np.array(
    [
        np.roll([0.0, 1.0, sign * GOLDEN_RATIO], turn) / sqrt(1.0 + GOLDEN_RATIO**2)
        for turn in range(3)
        for sign in (1.0, -1.0)
    ]
)
INRADIUS = sqrt((5.0 + 2.0 * sqrt(5.0)) / 15.0)  # [-] of a regular dodecahedron over its circumradius: 0.795


@declared
class Ball:
    """A place that is met within a radius of its centre."""

    centre: Vector3  # [m] world
    radius: Positive  # [m] from it, at most

    @property
    def inscribed(self) -> tuple[Condition, ...]:
        """The linear conditions of the regular dodecahedron that is inscribed in the ball."""
        return within(FACES, FACES @ self.centre, INRADIUS * self.radius)

    @property
    def circumscribed(self) -> tuple[Condition, ...]:
        """The linear conditions of the cube along the world's axes that encloses the ball."""
        return within(np.eye(3), self.centre, self.radius)
