"""Separation of bodies from convex pieces: the gap is the distance, as the nearest points themselves show."""

import numpy as np
import pytest

from aerobat import so3
from aerobat.arrays import Array
from aerobat.environment.obstacles import ConvexPiece, Pieces

ALONG = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
RING = np.column_stack([np.cos(ALONG), np.sin(ALONG), 0.0 * ALONG])
HULLS = {
    "ball": (np.zeros((1, 3)), 0.5 * np.eye(3)),
    "cylinder": (np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]), 0.4 * np.diag([1.0, 1.0, 0.0])),
    "box": (np.array(np.meshgrid([-1, 1], [-0.1, 0.1], [-0.7, 0.7])).reshape(3, 8).T, np.zeros((3, 3))),
    "prism": (np.concatenate([RING, RING + 0.5 * so3.UP]), np.zeros((3, 3))),
    "cone": (np.concatenate([RING, [[0.0, 0.0, 1.0]]]), np.zeros((3, 3))),
}


@pytest.mark.parametrize("hull", HULLS)
def test_no_two_points_of_body_and_piece_are_nearer_than_the_gap_and_some_are_as_near(hull: str) -> None:
    random = np.random.default_rng(0)
    piece, bodies = Pieces((ConvexPiece(*HULLS[hull]),)), 300
    centres = random.normal(size=(bodies, 3)) * 1.5
    shapes = so3.axes(so3.normalize(random.normal(size=(bodies, 4)))) * [0.2, 0.2, 0.06]
    found = piece.separated(np.zeros(bodies, dtype=np.intp), centres, shapes)
    lies_flat = np.linalg.norm(found.normals @ piece.pieces[0].rounding, axis=1) < 1e-2  # on no single point
    apart = np.flatnonzero((found.gaps > 0.0) & ~(lies_flat & (hull == "cylinder")))
    assert len(apart) > bodies / 2
    for k in apart:
        distance = _distance(piece.pieces[0], centres[k], shapes[k], found.normals[k])
        assert found.gaps[k] == pytest.approx(distance, abs=1e-5)


def _distance(piece: ConvexPiece, centre: Array, shape: Array, normal: Array) -> float:
    """How far the point of a body that is foremost against a normal is from the piece."""
    from scipy.optimize import nnls

    rounded = piece.rounding @ piece.rounding.T @ normal
    rounded /= max(float(np.linalg.norm(piece.rounding.T @ normal)), 1e-12)
    body = centre - shape @ shape.T @ normal / np.linalg.norm(shape.T @ normal)
    away = (body - piece.points - rounded).T
    _, distance = nnls(np.vstack([away, np.full(away.shape[1], 1e5)]), np.array([0.0, 0.0, 0.0, 1e5]))
    return float(distance)
