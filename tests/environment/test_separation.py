"""Bodies are separated from pieces by the best of all planes: as far apart as another library says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from aerobat import so3
from aerobat.arrays import Array
from aerobat.environment.obstacles import ConvexPiece, Pieces
from aerobat.environment.obstacles.convex_piece import ObstacleMotion
from fcl_peer import EXACT, distance, solid
from random_obstacles import KINDS, random_obstacle
from suites import examples

COUNT = 100
FINE = 1e-6  # [m] what our distances are good for

kinds = st.sampled_from(KINDS)
seeds = st.integers(0, 10**6)


def random_body(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A centre, axes as columns and semi-axes, some flat as a coin, some as long as a stick."""
    q = rng.normal(size=4)
    return 1.5 * rng.normal(size=3), so3.axes(q / np.linalg.norm(q)), 10 ** rng.uniform(-1.5, -0.3, 3)


def gap(piece: ConvexPiece, centre: np.ndarray, shape: np.ndarray) -> float:
    return float(Pieces((piece,)).separated(np.zeros(1, dtype=int), centre[None], shape[None]).gaps[0])


def moved(piece: ConvexPiece, turn: np.ndarray, shift: np.ndarray) -> ConvexPiece:
    return ConvexPiece(piece.points @ turn.T + shift, turn @ piece.rounding)


@pytest.mark.parametrize("kind", KINDS)
def test_the_gap_is_the_distance_that_another_library_finds(kind):
    rng = np.random.default_rng(KINDS.index(kind))
    apart = 0
    for _ in range(COUNT):
        obstacle, (centre, axes, semi_axes) = random_obstacle(rng, kind, np.zeros(3), 0.5), random_body(rng)
        found, exact = (
            gap(obstacle.pieces[0], centre, axes * semi_axes),
            distance(solid(obstacle), centre, axes, semi_axes),
        )
        assert (found > 0.0) == (exact > 0.0)
        if found > 0.0:
            assert found == pytest.approx(exact, abs=EXACT)
            apart += 1
    assert apart > COUNT / 4


@examples(60)
@given(kind=kinds, seed=seeds)
def test_moving_and_turning_body_and_piece_together_changes_nothing(kind, seed):
    rng = np.random.default_rng(seed)
    piece, (centre, axes, semi_axes) = random_obstacle(rng, kind, np.zeros(3)).pieces[0], random_body(rng)
    (shift, turn, _), shape = random_body(rng), axes * semi_axes
    found = gap(piece, centre, shape)
    again = gap(moved(piece, turn, shift), turn @ centre + shift, turn @ shape)
    if found > 0.0:
        assert again == pytest.approx(found, abs=FINE)
    else:  # of several ways out of a piece another may be taken, never out of it
        assert again < FINE


@examples(60)
@given(kind=kinds, seed=seeds)
def test_no_other_plane_separates_better_and_the_plane_touches_the_piece(kind, seed):
    rng = np.random.default_rng(seed)
    piece, (centre, axes, semi_axes) = random_obstacle(rng, kind, np.zeros(3)).pieces[0], random_body(rng)
    shape = axes * semi_axes
    found = Pieces((piece,)).separated(np.zeros(1, dtype=int), centre[None], shape[None])
    around = found.normals + rng.choice([1e-3, 1e-1, 1.0], (500, 1)) * rng.normal(size=(500, 3))
    normals = np.concatenate([found.normals, around / np.linalg.norm(around, axis=1, keepdims=True)])
    gaps = normals @ centre - np.linalg.norm(normals @ shape, axis=1) - piece.support(normals)
    assert found.offsets[0] == pytest.approx(piece.support(found.normals)[0], abs=1e-9)
    assert found.gaps[0] == pytest.approx(gaps[0], abs=1e-9)
    if found.gaps[0] > 0.0:
        assert gaps.max() <= found.gaps[0] + FINE


@examples(60)
@given(kind=kinds, seed=seeds)
def test_a_body_about_a_point_of_the_piece_overlaps(kind, seed):
    rng = np.random.default_rng(seed)
    piece, (_, axes, semi_axes) = random_obstacle(rng, kind, np.zeros(3)).pieces[0], random_body(rng)
    share = rng.dirichlet(np.ones(len(piece.points)))
    inside, shape = share @ piece.points, axes * semi_axes
    assert gap(piece, inside, shape) < 0.0
    assert gap(piece, inside + shape @ so3.UP, shape) < FINE  # it touches with its tip


@examples(30)
@given(kind=kinds, seed=seeds)
def test_pairs_do_not_know_one_another(kind, seed):
    rng = np.random.default_rng(seed)
    obstacles = [random_obstacle(rng, each, rng.normal(size=3)) for each in (kind, *KINDS)]
    pieces = Pieces(tuple(piece for obstacle in obstacles for piece in obstacle.pieces))
    bodies = [random_body(rng) for _ in pieces.pieces]
    centres = np.array([body[0] for body in bodies])
    shapes = np.array([axes * semi_axes for _, axes, semi_axes in bodies])
    found = pieces.separated(np.arange(len(pieces)), centres, shapes)
    alone = [gap(*each) for each in zip(pieces.pieces, centres, shapes, strict=True)]
    apart = found.gaps > 0.0
    assert found.gaps[apart] == pytest.approx(np.array(alone)[apart], abs=FINE)


@given(seed=seeds)
def test_boxes_around_pieces_are_no_farther_than_the_pieces(seed):
    rng = np.random.default_rng(seed)
    pieces = Pieces(tuple(random_obstacle(rng, kind, rng.normal(size=3)).pieces[0] for kind in KINDS))
    points = 3.0 * rng.normal(size=(20, 3))
    bodies, numbers = np.divmod(np.arange(20 * len(pieces)), len(pieces))
    exact = pieces.separated(numbers, points[bodies], np.zeros((len(bodies), 3, 3))).gaps
    assert (pieces.box_distances(points, points).ravel() <= np.maximum(exact, 0.0) + FINE).all()
    near = set(zip(*map(np.ndarray.tolist, pieces.near(points, 0.0, 0.5)), strict=True))
    assert {(int(b), int(n)) for b, n, far in zip(bodies, numbers, exact, strict=True) if far < 0.49} <= near


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


@given(
    rows=st.integers(0, 9).flatmap(lambda count: arrays(np.float64, (count, 3), elements=st.floats(-5, 5))),
    velocity=arrays(np.float64, 3, elements=st.floats(-2, 2)),
    times=arrays(np.float64, (6, 2), elements=st.floats(-2, 12)),
)
def test_what_moves_reaches_as_far_as_it_is_at_any_instant_between(
    rows: np.ndarray, velocity: np.ndarray, times: np.ndarray
) -> None:
    motion = ObstacleMotion(velocity, np.column_stack([np.arange(len(rows)) * 1.25, rows]))
    begin, end = np.sort(times, axis=1).T
    lower, upper = motion.reach(begin, end)
    between = np.clip(motion.times[:, None], begin, end)  # where it turns, and nowhere else
    seen = motion.moved(np.concatenate([np.linspace(begin, end, 5), between]))
    assert np.allclose(lower, seen.min(axis=0))
    assert np.allclose(upper, seen.max(axis=0))
