"""Obstacles in figures and videos: faces toward the viewer as glass, and nothing where there are none."""

from __future__ import annotations

import numpy as np
import pytest

import aerobat as ab
from aerobat.environment.obstacles.surface import surface_of
from aerobat.evaluation.subject import subject_of
from aerobat.reporting.figures import report_figure
from aerobat.reporting.motion.picture import MovingPicture
from aerobat.reporting.panels.timelines import clearances
from aerobat.reporting.scene import axes_box
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
    monkeypatch.setattr(axes_box, "draw_axes_box", lambda axes, box, camera: boxes.append(box))
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


def test_the_clearance_is_the_distance_from_the_nearest_obstacle_however_far() -> None:
    """A level body beside a wall, above a ball and far from both."""
    vehicle = ab.load_vehicle("agile-quad")
    body = vehicle.bounding_ellipsoid
    wall = ab.HalfSpace((0.0, 5.0, 0.0), (0.0, -1.0, 0.0))
    ball = ab.Sphere((0.0, 0.0, -1.0), 0.5)
    pieces = ab.Environment(obstacles=(wall, ball)).pieces
    places = np.array([[0.0, 4.0, 1.0], [0.0, 0.0, 0.0], [0.0, -40.0, 0.0], [0.0, 4.9, 1.0]])
    level = np.tile([1.0, 0.0, 0.0, 0.0], (4, 1))
    wide, high = body.semi_axes[1], body.semi_axes[2]
    offset = body.centre
    found = clearances(places - offset, level, vehicle, pieces, np.zeros(4))
    far = np.hypot(40.0, 1.0) - 0.5
    assert found[:2] == pytest.approx([1.0 - wide, 0.5 - high], abs=1e-5)
    assert far - wide - 1e-3 < found[2] < far - high
    assert found[3] < 0.0


def test_the_clearance_from_what_moves_is_that_from_where_it_is_then() -> None:
    vehicle, times = ab.load_vehicle("agile-quad"), np.array([0.0, 1.0, 2.5])
    ball = ab.Sphere((3.0, 0.0, 0.0), 0.5, velocity=(0.0, 2.0, 0.0))
    level, places = np.tile([1.0, 0.0, 0.0, 0.0], (3, 1)), np.zeros((3, 3))
    found = clearances(places, level, vehicle, ab.Environment(obstacles=(ball,)).pieces, times)
    still = [ab.Sphere((3.0, 2.0 * time, 0.0), 0.5) for time in times.tolist()]
    then = [
        clearances(places[:1], level[:1], vehicle, ab.Environment(obstacles=(each,)).pieces, times[:1])[0]
        for each in still
    ]
    assert found == pytest.approx(then, abs=1e-9)
    assert found[0] < found[1] < found[2]


def test_a_report_has_the_clearance_where_there_are_obstacles_and_only_there() -> None:
    for plan, shown in ((open_cruise(), False), (walled_cruise(), True)):
        for flight in (None, ab.fly(plan, rate=100.0, engine="floats")):
            page = report_figure(plan, plan.vehicle, flight)
            labels = [axes.get_ylabel() for axes in page.axes]
            assert labels.count("clearance [m]") == shown
