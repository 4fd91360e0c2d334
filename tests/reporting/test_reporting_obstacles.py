"""Obstacles in figures and videos: faces toward the viewer as glass, and nothing where there are none."""

from __future__ import annotations

import numpy as np
import pytest

import aerobat as ab
from aerobat.environment.obstacles.surface import surface_of
from aerobat.reporting.figures import report_figure
from aerobat.reporting.motion.picture import MovingPicture, subject_of
from aerobat.reporting.panels import path as path_panel
from aerobat.reporting.scene.camera import Camera
from aerobat.reporting.scene.obstacles import obstacle_shapes
from obstacle_cases import open_cruise, walled_cruise

CAMERA = Camera(0.7, 0.4)


def area(corners: np.ndarray) -> float:
    """Positive where corners go anticlockwise."""
    (x, y), (next_x, next_y) = corners.T, np.roll(corners, -1, axis=0).T
    return float((x * next_y - y * next_x).sum()) / 2.0


@pytest.mark.parametrize(
    "obstacle", [ab.Sphere((0.0, 0.0, 0.0), 1.0), ab.Box((0.0, 0.0, 0.0), (1.0, 2.0, 3.0))]
)
def test_the_faces_that_are_drawn_cover_what_is_seen_of_an_obstacle_once(obstacle: ab.Obstacle) -> None:
    from scipy.spatial import ConvexHull

    surface = surface_of(obstacle.pieces[0])
    drawn = [shape for shape in obstacle_shapes([surface], CAMERA) if shape.face != "none"]
    pictures = [CAMERA.project(shape.points) for shape in drawn]
    areas = [area(picture) for picture in pictures]
    assert min(areas) > -1e-12, "no face is seen from behind"
    assert sum(areas) == pytest.approx(ConvexHull(CAMERA.project(surface.points)).volume)


def test_a_picture_holds_the_obstacles_beside_its_path(monkeypatch: pytest.MonkeyPatch) -> None:
    boxes = []
    monkeypatch.setattr(path_panel, "draw_axes_box", lambda axes, box, camera: boxes.append(box))
    for plan in (open_cruise(), walled_cruise()):
        report_figure(plan, plan.vehicle)
    free, walled = boxes
    assert walled.upper[1] >= 1.0, "the trunk's far side"
    assert free.upper[2] < 2.0 <= walled.upper[2], "the trunk's top"


def test_glass_leaves_what_is_behind_it_to_be_seen() -> None:
    shapes = obstacle_shapes(
        [surface_of(piece) for piece in walled_cruise().problem.surroundings.pieces.pieces], CAMERA
    )
    assert all(
        isinstance(shape.face, tuple) and shape.face[1] < 0.5 for shape in shapes if shape.face != "none"
    )


def test_a_video_shows_obstacles() -> None:
    frames = [
        MovingPicture(subject_of(plan, None, None), 40).at(0.2) for plan in (open_cruise(), walled_cruise())
    ]
    assert (frames[0] != frames[1]).any()
