"""The visible parts of obstacles around a path: surfaces of pieces, without the parts inside other pieces.

Pieces of one obstacle, for instance of a wall, touch and overlap. In transparent pictures, surfaces inside
other pieces would be visible.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from aerobat.arrays import Array
from aerobat.environment.obstacles.convex_piece import ConvexPiece
from aerobat.environment.obstacles.surface import Surface, beyond, surface_of

# fractions of the longest side of the picture: obstacles are cut at the first, or shown whole if they end
# within the second
CUT_MARGIN, WHOLE_MARGIN = 0.25, 0.5
FACE_TOLERANCE = 1e-6  # [m] distance within which faces are coplanar
MIN_AREA = 1e-6  # [m²] smallest area of a face
MAX_CUT_PIECES = 300  # limit of pieces; with more, as in a map, each is drawn unchanged


def surfaces_around(pieces: Sequence[ConvexPiece], points: Array) -> tuple[Surface, ...]:
    """Return the visible surfaces of the pieces near points [m], (n, 3), of the other objects in a picture.

    Distant parts are cut off, except of moving pieces.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    size = float((high - low).max())
    lower, upper = low - CUT_MARGIN * size, high + CUT_MARGIN * size
    still = [each for each in pieces if each.motion is None]
    near = [each for each in still if (each.box[0] <= upper).all() and (each.box[1] >= lower).all()]
    whole = [surface_of(piece) for piece in near]
    parts = _visible_parts(near, whole) if len(near) <= MAX_CUT_PIECES else whole
    margin = WHOLE_MARGIN * size
    found = (
        part
        if (part.points >= low - margin).all() and (part.points <= high + margin).all()
        else part.within(lower, upper)
        for part in parts
    )
    moving = (surface_of(piece) for piece in pieces if piece.motion is not None)
    return tuple(surface for surface in (*found, *moving) if surface.faces)


def _visible_parts(pieces: Sequence[ConvexPiece], surfaces: Sequence[Surface]) -> Iterator[Surface]:
    """Yield the surfaces without the parts inside other pieces; a shared face belongs to the first of two."""
    solids = [_Solid.of(surface) for surface in surfaces]
    boxes = np.array([piece.box for piece in pieces]).reshape(-1, 2, 3)
    for k, surface in enumerate(surfaces):
        lower, upper = boxes[k, 0] - FACE_TOLERANCE, boxes[k, 1] + FACE_TOLERANCE
        touches = (boxes[:, 0] <= upper) & (boxes[:, 1] >= lower)
        others = [j for j in np.flatnonzero(touches.all(axis=1)).tolist() if j != k]
        if not others:
            yield surface
            continue
        faces, edges = list(surface.faces), list(surface.edges)
        for j in others:
            offset = FACE_TOLERANCE if j < k else -FACE_TOLERANCE
            faces = [part for face in faces for part in solids[j].outside(face, offset)]
            edges = [part for edge in edges for part in solids[j].outside(edge, FACE_TOLERANCE)]
        yield Surface(surface.name, tuple(faces), np.array(edges).reshape(-1, 2, 3))


@dataclass(frozen=True, eq=False)
class _Solid:
    """The set of points with normals · point ≤ levels."""

    normals: Array  # (n, 3)
    levels: Array  # [m], (n,)

    @classmethod
    def of(cls, surface: Surface) -> _Solid:
        """Return the solid inside a surface."""
        normals = np.array([np.cross(face[1] - face[0], face[2] - face[0]) for face in surface.faces])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return cls(normals, np.sum(normals * [face[0] for face in surface.faces], axis=1))

    def outside(self, corners: Array, offset: float) -> list[Array]:
        """Return the parts of a convex polygon or line outside the solid, enlarged by `offset` [m]."""
        heights = corners @ self.normals.T - self.levels - offset
        if (heights >= 0.0).all(axis=0).any():
            return [corners]
        parts, rest = [], corners
        for normal, level in zip(self.normals, self.levels + offset, strict=True):
            if not len(rest):
                break
            part = beyond(rest, rest @ normal - level)
            if _is_seen(part, len(corners)):
                parts.append(part)
            rest = beyond(rest, level - rest @ normal)
        return parts if len(rest) else [corners]


def _is_seen(part: Array, corners: int) -> bool:
    """Return True for a remaining part of a polygon or line that is more than its rim."""
    if len(part) < min(corners, 3):
        return False
    if corners == 2:
        return bool(np.linalg.norm(part[1] - part[0]) > FACE_TOLERANCE)
    spokes = part[1:] - part[0]
    return bool(np.linalg.norm(np.cross(spokes[:-1], spokes[1:]).sum(axis=0)) / 2.0 > MIN_AREA)
