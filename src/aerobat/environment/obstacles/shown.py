"""The parts of obstacles that are seen around a path: surfaces of pieces, without what lies in others.

Pieces of one obstacle touch and lie over one another, as those of a wall do. Drawn as glass, what two of them
share would be seen twice.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from aerobat.arrays import Array
from aerobat.environment.obstacles.convex_piece import ConvexPiece
from aerobat.environment.obstacles.surface import Surface, beyond, surface_of

NEAR, WHOLE = 0.25, 0.5  # of the longest side of what is shown: shown from there, whole if it ends there
ALIKE = 1e-6  # [m] within which faces lie in one plane
LEAST_AREA = 1e-6  # [m²] of a face
MANY = 300  # pieces: of more, as of a map, each is drawn as it is


def surfaces_around(pieces: Sequence[ConvexPiece], points: Array) -> tuple[Surface, ...]:
    """Return what is seen of the pieces near points; what reaches far from them is cut off there.

    Args:
        pieces: In the world; those that move are whole.
        points: What else is shown [m], (n, 3).
    """
    low, high = points.min(axis=0), points.max(axis=0)
    size = float((high - low).max())
    lower, upper = low - NEAR * size, high + NEAR * size
    still = [each for each in pieces if each.motion is None]
    near = [each for each in still if (each.box[0] <= upper).all() and (each.box[1] >= lower).all()]
    whole = [surface_of(piece) for piece in near]
    parts = _apart(near, whole) if len(near) <= MANY else whole
    margin = WHOLE * size
    found = (
        part
        if (part.points >= low - margin).all() and (part.points <= high + margin).all()
        else part.within(lower, upper)
        for part in parts
    )
    moving = (surface_of(piece) for piece in pieces if piece.motion is not None)
    return tuple(surface for surface in (*found, *moving) if surface.faces)


def _apart(pieces: Sequence[ConvexPiece], surfaces: Sequence[Surface]) -> Iterator[Surface]:
    """The surfaces without what lies in other pieces; a face that two of them share is the first one's."""
    solids = [_Solid.of(surface) for surface in surfaces]
    boxes = np.array([piece.box for piece in pieces]).reshape(-1, 2, 3)
    for k, surface in enumerate(surfaces):
        touches = (boxes[:, 0] <= boxes[k, 1] + ALIKE) & (boxes[:, 1] >= boxes[k, 0] - ALIKE)
        others = [j for j in np.flatnonzero(touches.all(axis=1)).tolist() if j != k]
        if not others:
            yield surface
            continue
        faces, edges = list(surface.faces), list(surface.edges)
        for j in others:
            grown = ALIKE if j < k else -ALIKE
            faces = [part for face in faces for part in solids[j].outside(face, grown)]
            edges = [part for edge in edges for part in solids[j].outside(edge, ALIKE)]
        yield Surface(surface.name, tuple(faces), np.array(edges).reshape(-1, 2, 3))


@dataclass(frozen=True, eq=False)
class _Solid:
    """All points with normals · point ≤ levels."""

    normals: Array  # (n, 3)
    levels: Array  # [m], (n,)

    @classmethod
    def of(cls, surface: Surface) -> _Solid:
        """The solid within a surface."""
        normals = np.array([np.cross(face[1] - face[0], face[2] - face[0]) for face in surface.faces])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return cls(normals, np.sum(normals * [face[0] for face in surface.faces], axis=1))

    def outside(self, corners: Array, grown: float) -> list[Array]:
        """The parts of a convex polygon, or of a line, outside the solid that is `grown` [m] to all sides."""
        heights = corners @ self.normals.T - self.levels - grown
        if (heights >= 0.0).all(axis=0).any():
            return [corners]
        parts, rest = [], corners
        for normal, level in zip(self.normals, self.levels + grown, strict=True):
            if not len(rest):
                break
            part = beyond(rest, rest @ normal - level)
            if _is_seen(part, len(corners)):
                parts.append(part)
            rest = beyond(rest, level - rest @ normal)
        return parts if len(rest) else [corners]


def _is_seen(part: Array, corners: int) -> bool:
    """True for what is left of a polygon, or of a line, and not only its rim."""
    if len(part) < min(corners, 3):
        return False
    if corners == 2:
        return bool(np.linalg.norm(part[1] - part[0]) > ALIKE)
    spokes = part[1:] - part[0]
    return bool(np.linalg.norm(np.cross(spokes[:-1], spokes[1:]).sum(axis=0)) / 2.0 > LEAST_AREA)
