"""Surfaces of obstacles: what pictures and exports draw is what planners and certificates avoid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import aerobat as ab
from aerobat.environment.obstacles import Obstacle
from aerobat.environment.obstacles.surface import Surface, flattening, surface_of
from aerobat.environment.obstacles.visible_surfaces import surfaces_around

OBSTACLES = {
    each.kind: each
    for each in (
        ab.Box((1.0, 2.0, 3.0), (1.0, 2.0, 3.0), heading=0.3, elevation=0.2, tilt=0.4),
        ab.Sphere((1.0, 2.0, 3.0), 0.7),
        ab.Capsule((0.0, 0.0, 0.0), (1.0, 2.0, 3.0), 0.4),
        ab.Cylinder((0.0, 0.0, 0.0), (1.0, 2.0, 3.0), 0.4),
        ab.HalfSpace((0.0, 0.0, 3.0), (0.0, 0.1, -1.0)),
        ab.Polytope(np.random.default_rng(0).normal(size=(20, 3))),
    )
}
WALL = ab.Wall(border=1.0, thickness=0.1)


def slit_wall() -> Obstacle:
    """The wall around a tilted slit of 0.7 by 0.12 m at the origin."""
    gate = replace(ab.tilted_gate((0.0, 0.0, 0.0), tilt=1.2, width=0.7, height=0.12), wall=WALL)
    assert gate.solid is not None
    return gate.solid


def directions(count: int = 2000) -> np.ndarray:
    made = np.random.default_rng(1).normal(size=(count, 3))
    return made / np.linalg.norm(made, axis=1, keepdims=True)


def area(surfaces: tuple[Surface, ...]) -> float:
    a, b, c = np.concatenate([surface.triangles for surface in surfaces]).swapaxes(0, 1)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2.0


@pytest.mark.parametrize("kind", OBSTACLES)
def test_a_surface_reaches_as_far_as_its_piece_less_what_is_flattened(kind: str) -> None:
    (piece,) = OBSTACLES[kind].pieces
    lacks = piece.support(directions()) - (directions() @ surface_of(piece).points.T).max(axis=1)
    assert lacks.min() >= -1e-9
    assert lacks.max() <= flattening(piece) + 1e-9
    assert flattening(piece) < 0.02 * max(np.linalg.norm(piece.rounding, 2), 1e-9)


@pytest.mark.parametrize("kind", OBSTACLES)
def test_a_surface_is_closed_and_looks_outward(kind: str) -> None:
    """The volume that its triangles enclose is that of the hull of their corners."""
    from scipy.spatial import ConvexHull

    surface = surface_of(OBSTACLES[kind].pieces[0])
    middle = surface.points.mean(axis=0)
    volume = float(np.linalg.det(surface.triangles - middle).sum()) / 6.0
    assert volume == pytest.approx(ConvexHull(surface.points).volume)


def test_edges_are_drawn_where_faces_meet_sharply() -> None:
    edges = {kind: len(surface_of(obstacle.pieces[0]).edges) for kind, obstacle in OBSTACLES.items()}
    assert edges["box"] == 12
    assert edges["cylinder"] == 48, "the rims of both ends, nothing along its side"
    assert edges["sphere"] == edges["capsule"] == 0


def test_a_wall_is_seen_once_however_its_parts_lie_over_one_another() -> None:
    """Its surface is two sides with a hole, and the rims outside and within."""
    far = np.array([[-9.0, -9.0, -9.0], [9.0, 9.0, 9.0]])
    outer, inner = np.array([2.7, 2.12]), np.array([0.7, 0.12])
    sides = 2.0 * float(outer.prod() - inner.prod())
    rims = WALL.thickness * 2.0 * float(outer.sum() + inner.sum())
    assert area(surfaces_around(slit_wall().pieces, far)) == pytest.approx(sides + rims, rel=1e-4)


def test_what_reaches_far_is_cut_off_and_what_is_far_is_left_out() -> None:
    ceiling, tree = ab.HalfSpace((0.0, 0.0, 3.0), (0.0, 0.0, -1.0)), OBSTACLES["sphere"]
    moved = replace(tree, position=np.array([40.0, 0.0, 1.0]))
    path = np.array([[0.0, 0.0, 1.0], [8.0, 0.0, 1.0]])
    (seen,) = surfaces_around((*ceiling.pieces, *moved.pieces), path)
    assert seen.points.min(axis=0) == pytest.approx([-2.0, -2.0, 3.0])
    assert seen.points.max(axis=0) == pytest.approx([10.0, 2.0, 3.0]), "its plane alone"
    assert len(surfaces_around(tree.pieces, path)) == 1
