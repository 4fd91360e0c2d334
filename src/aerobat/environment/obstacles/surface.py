"""The surface of a convex piece as flat faces, for pictures, exports and other engines.

Corners and edges of the hull are exact. A rounding is sampled on its ellipsoid, so faces lie inside the round
parts, by at most `flattening`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.environment.obstacles.convex_piece import ConvexPiece, ObstacleMotion

FACETS = 24  # facets around round parts, a multiple of four: 15° from each to the next
# cosine of the smallest angle between faces at a sharp edge; facets of round parts meet at less
SHARP = np.cos(np.deg2rad(20.0))
PLANES_ALIKE = 5  # decimals to which triangles of one face have the same plane
THIN = 1e-4  # [m] half thickness given to a flat piece
TINY = 1e-9  # [m]


@dataclass(frozen=True, eq=False)
class Surface:
    """Flat convex faces in the world, and their sharp edges."""

    name: str  # name of the obstacle
    faces: tuple[Array, ...]  # corners of each [m], anticlockwise from outside, (k, 3)
    edges: Array  # [m] ends of the sharp edges, (n, 2, 3)
    motion: ObstacleMotion | None = None  # motion away from the initial place

    def at(self, time: float) -> Surface:
        """Return the surface at its place at a time [s]."""
        if self.motion is None:
            return self
        moved = self.motion.moved(np.array(time))
        return Surface(self.name, tuple(face + moved for face in self.faces), self.edges + moved)

    @property
    def points(self) -> Array:
        """The corners of all faces [m], (n, 3)."""
        return np.concatenate([*self.faces, np.zeros((0, 3))])

    @cached_property
    def triangles(self) -> Array:
        """The faces as triangles [m], (n, 3, 3)."""
        fans = [
            np.stack([np.broadcast_to(face[0], (len(face) - 2, 3)), face[1:-1], face[2:]], axis=1)
            for face in self.faces
        ]
        return np.concatenate([*fans, np.zeros((0, 3, 3))])

    def within(self, lower: Array, upper: Array) -> Surface:
        """Return the part inside the box with these corners [m], (3,) each, open where the box cuts it."""
        points = self.points
        if len(points) and (points >= lower).all() and (points <= upper).all():
            return self
        faces = (clipped(face, lower, upper) for face in self.faces)
        lines = [clipped(edge, lower, upper) for edge in self.edges]
        edges = [line for line in lines if len(line) > 1]
        kept = tuple(face for face in faces if len(face) > 2)
        return Surface(self.name, kept, np.array(edges).reshape(-1, 2, 3), self.motion)


def surface_of(piece: ConvexPiece) -> Surface:
    """Return the surface of a convex piece, in the world."""
    points = (piece.points[:, None] + _rounding(piece)).reshape(-1, 3)
    faces = _faces(points)
    return Surface(piece.name, faces, _sharp_edges(faces), piece.motion)


def flattening(piece: ConvexPiece) -> float:
    """Return the largest distance [m] of the surface from the piece's round parts, inside them."""
    _, sizes, rank = _axes(piece.rounding)
    return float(sizes[0]) * (1.0 - _depth(rank)) if rank else 0.0


def _axes(rounding: Array) -> tuple[Array, Array, int]:
    """Return the axes (3, 3), semi-axes [m] (3,) and rank of a rounding's ellipsoid."""
    axes, sizes, _ = np.linalg.svd(rounding)
    return axes, sizes, int(np.sum(sizes > TINY))


def _rounding(piece: ConvexPiece) -> Array:
    """Return points on the ellipsoid that rounds a piece [m], (n, 3)."""
    axes, sizes, rank = _axes(piece.rounding)
    directions = _directions(rank)
    if rank == 3:  # the equator is where a tube along the piece is widest
        along = np.linalg.svd(piece.points - piece.points.mean(axis=0))[2][0]
        pole = (axes.T @ along) / sizes
        turn = so3.smallest_rotation(so3.UP, pole / np.linalg.norm(pole))
        directions = so3.rotate(turn, directions)
    return np.asarray((directions * sizes[:rank]) @ axes[:, :rank].T)


@cache
def _directions(dimensions: int) -> Array:
    """Return unit vectors, evenly distributed in a space of some dimensions, (n, dimensions)."""
    turn = 2.0 * np.pi * np.arange(FACETS) / FACETS
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    if dimensions < 2:
        return np.array([[1.0], [-1.0]]) if dimensions else np.zeros((1, 0))
    if dimensions == 2:
        return circle
    # latitudes of rings, without the poles
    latitudes = np.pi * (np.arange(1, FACETS // 2) / (FACETS // 2) - 0.5)
    levels = zip(np.cos(latitudes), np.sin(latitudes), strict=True)
    rings = [np.column_stack([c * circle, np.full(FACETS, s)]) for c, s in levels]
    return np.concatenate([*rings, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])


@cache
def _depth(dimensions: int) -> float:
    """Return the radius of the ball inside the hull of these unit vectors."""
    from scipy.spatial import ConvexHull

    if dimensions < 2:
        return 1.0
    return float(-ConvexHull(_directions(dimensions)).equations[:, -1].max())


def _faces(points: Array) -> tuple[Array, ...]:
    """Return the faces of the hull of points, with coplanar triangles merged."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except QhullError:  # a plate is given a thickness
        thick = THIN * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
        hull = ConvexHull((points[:, None] + thick).reshape(-1, 3))
    scale = np.append(np.ones(3), 1.0 / max(float(np.ptp(hull.points, axis=0).max()), TINY))
    planes = np.round(hull.equations * scale, PLANES_ALIKE) + 0.0
    _, groups = np.unique(planes, axis=0, return_inverse=True)
    order = np.argsort(groups.ravel(), kind="stable")
    starts = np.flatnonzero(np.diff(groups.ravel()[order])) + 1
    return tuple(
        _around(hull.points[np.unique(hull.simplices[rows])], hull.equations[rows[0], :3])
        for rows in np.split(order, starts)
    )


def _around(corners: Array, normal: Array) -> Array:
    """Return the corners of a face, anticlockwise about its normal, (k, 3)."""
    spokes = corners - corners.mean(axis=0)
    first = spokes[0] / np.linalg.norm(spokes[0])
    second = np.cross(normal, first)
    return np.asarray(corners[np.argsort(np.arctan2(spokes @ second, spokes @ first), kind="stable")])


def _sharp_edges(faces: Sequence[Array]) -> Array:
    """Return the ends of the edges whose two faces meet at a sharp angle, (n, 2, 3)."""
    normals: dict[frozenset[tuple[float, ...]], list[Array]] = {}
    ends: dict[frozenset[tuple[float, ...]], Array] = {}
    for face in faces:
        normal = np.cross(face[1] - face[0], face[2] - face[0])
        normal /= max(float(np.linalg.norm(normal)), TINY**2)
        for a, b in pairwise([*face, face[0]]):
            key = frozenset([tuple(a.tolist()), tuple(b.tolist())])
            normals.setdefault(key, []).append(normal)
            ends[key] = np.array([a, b])
    sharp = [ends[k] for k, (n, *others) in normals.items() if all(n @ other < SHARP for other in others)]
    return np.array(sharp).reshape(-1, 2, 3)


def clipped(corners: Array, lower: Array, upper: Array) -> Array:
    """Return the part of a convex polygon or line inside a box, (k, 3), by Sutherland and Hodgman."""
    for axis in range(3):
        for sign, level in ((1.0, lower[axis]), (-1.0, -upper[axis])):
            if not len(corners):
                return corners
            corners = beyond(corners, sign * corners[:, axis] - level)
    return corners


def beyond(corners: Array, height: Array) -> Array:
    """Return the part of a convex polygon or line where the height (k,) is nonnegative."""
    if (height >= 0.0).all():
        return corners
    kept: list[Array] = []
    for k, corner in enumerate(corners):
        last = k - 1
        is_side = k > 0 or len(corners) > 2  # a line has one side
        if is_side and (height[k] >= 0.0) != (height[last] >= 0.0):
            kept.append(corners[last] + height[last] / (height[last] - height[k]) * (corner - corners[last]))
        if height[k] >= 0.0:
            kept.append(corner)
    return np.array(kept).reshape(-1, corners.shape[1])
