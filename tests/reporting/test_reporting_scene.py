"""Scenes: orthographic views, painting order, gates and vehicles as they are."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from aerobat import so3
from aerobat.problem import tilted_gate
from aerobat.reporting.page import spread_out
from aerobat.reporting.scene.axes_box import box_around, draw_axes_box, draw_box_around
from aerobat.reporting.scene.camera import Camera, best_view
from aerobat.reporting.scene.glyphs import (
    direction_marks,
    enlargement,
    gate_bars,
    pose_shapes,
    side_face,
    span,
    vehicle_shapes,
)
from aerobat.reporting.scene.shapes import Shape, draw_depth_sorted
from aerobat.vehicle import load_vehicle, vehicle_names
from reporting_cases import require_legible
from suites import examples

angles = st.floats(-np.pi, np.pi)
cameras = st.builds(Camera, angles, st.floats(-1.5, 1.5))
points = st.tuples(*[st.floats(-5, 5)] * 3).map(np.array)
quaternions = st.tuples(*[st.floats(-1, 1)] * 4).map(np.array).filter(lambda q: np.linalg.norm(q) > 0.1)
gates = st.builds(
    tilted_gate,
    points,
    angles,
    st.floats(-1.5, 1.5),
    angles,
    st.floats(0.2, 3.0),
    st.floats(0.2, 3.0),
)


def blank_axes(width=6.0, height=6.0):
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure.add_axes((0, 0, 1, 1))


@given(cameras)
def test_a_camera_is_a_right_handed_frame_with_up_upward(camera):
    frame = np.array([*camera.screen, camera.toward])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0)
    assert camera.screen[1, 2] >= 0.0


@given(cameras, points)
def test_a_point_is_its_picture_and_its_nearness(camera, point):
    u, v = camera.project(point)
    rebuilt = u * camera.screen[0] + v * camera.screen[1] + camera.nearness(point) * camera.toward
    np.testing.assert_allclose(rebuilt, point, atol=1e-12)


@examples(25)
@given(cameras, st.lists(points, min_size=2, max_size=8))
def test_far_shapes_are_painted_first(camera, centres):
    apart = np.diff(np.sort([camera.nearness(centre) for centre in centres]))
    assume(np.all((apart == 0.0) | (apart > 1e-9)))  # else rounding decides
    offsets = np.array([[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [-0.1, -0.1, 0.0]])
    shapes = [Shape(centre + offsets, face="#000000") for centre in centres]
    collection = draw_depth_sorted(blank_axes(), shapes, camera)
    order = np.argsort([camera.nearness(centre) for centre in centres], kind="stable")
    painted = [path.vertices[:3] for path in collection.get_paths()]
    np.testing.assert_allclose(painted, [camera.project(shapes[k].points) for k in order], atol=1e-12)


@given(gates)
def test_the_inner_edge_of_a_drawn_gate_is_its_opening(gate):
    corners = np.concatenate(gate_bars(gate)).reshape(-1, 3)
    inside = (corners - gate.position) @ np.array([gate.lateral, gate.up]).T
    half = np.array([gate.width, gate.height]) / 2
    at_the_opening = corners[np.isclose(np.abs(inside), half, rtol=0, atol=1e-9).all(axis=1)]
    flat = at_the_opening - np.outer((at_the_opening - gate.position) @ gate.normal, gate.normal)
    for corner in gate.outline:  # each is drawn, half before and half behind the gate's plane
        assert np.linalg.norm(flat - corner, axis=1).min() < 1e-9
    assert np.isclose((at_the_opening - gate.position) @ gate.normal, 0.0).sum() == 0
    np.testing.assert_allclose(at_the_opening.mean(axis=0), gate.position, atol=1e-9)


@given(gates)
def test_no_bar_of_a_gate_reaches_into_its_opening(gate):
    corners = np.concatenate(gate_bars(gate)).reshape(-1, 3)
    inside = np.abs((corners - gate.position) @ np.array([gate.lateral, gate.up]).T)
    assert (inside >= np.array([gate.width, gate.height]) / 2 - 1e-9).any(axis=1).all()


@given(st.sampled_from(vehicle_names()), points, quaternions.map(so3.normalize), st.floats(0.5, 5))
def test_drawn_rotors_are_the_vehicle_s_in_its_attitude(name, position, q, scale):
    vehicle = load_vehicle(name)
    discs = vehicle_shapes(vehicle, position, q, scale)[len(vehicle.rotors) :]
    assert len(discs) == len(vehicle.rotors)
    for disc, rotor in zip(discs, vehicle.rotors, strict=True):
        rim = disc.points[:-1]
        hub = so3.unrotate(q, rim.mean(axis=0) - position) / scale
        np.testing.assert_allclose(hub[:2], rotor.position_body[:2], atol=1e-9)
        np.testing.assert_allclose((rim - rim.mean(axis=0)) @ so3.thrust_axis(q), 0.0, atol=1e-9)
        np.testing.assert_allclose(
            np.linalg.norm(rim - rim.mean(axis=0), axis=1), scale * rotor.radius, atol=1e-9
        )


@given(st.sampled_from(vehicle_names()), points, quaternions.map(so3.normalize))
def test_a_drawn_thrust_axis_is_the_attitude_s(name, position, q):
    foot, tip = pose_shapes(load_vehicle(name), position, q, 1.0, Camera(0.0))[0].points
    np.testing.assert_allclose(foot, position)
    np.testing.assert_allclose((tip - foot) / np.linalg.norm(tip - foot), so3.thrust_axis(q), atol=1e-9)


def test_upright_and_inverted_vehicles_differ_in_colour():
    above = Camera(0.3, 0.4)
    inverted = np.array([0.0, 1.0, 0.0, 0.0])
    assert side_face(so3.IDENTITY, above) != side_face(inverted, above)


@given(cameras, st.lists(points, min_size=3, max_size=3))
def test_arrowheads_point_the_way_that_is_travelled(camera, path):
    path = np.array(path)
    ahead = camera.project(path[2] - path[0])
    assume(np.linalg.norm(ahead) > 1e-3)
    [mark] = direction_marks(path, [1], camera, 0.1)
    tip, left, _, right = camera.project(mark.points[:4])
    forward = tip - (left + right) / 2
    np.testing.assert_allclose(forward / np.linalg.norm(forward), ahead / np.linalg.norm(ahead), atol=1e-6)


@given(st.sampled_from(vehicle_names()), st.floats(0.01, 5.0))
def test_a_vehicle_is_drawn_at_least_as_large_as_it_is(name, size):
    vehicle = load_vehicle(name)
    scale = enlargement(vehicle, size)
    assert scale >= 1.0
    assert scale == 1.0 or 0.8 * size <= scale * span(vehicle) <= 1.6 * size


@given(gates.filter(lambda gate: abs(gate.normal[2]) < 0.7), angles, st.floats(0.0, 1.0))
def test_the_chosen_view_shows_the_gate_open_and_the_path_spread(gate, heading, flatness):
    turn = np.linspace(0.0, 2 * np.pi, 60)
    across = np.array([np.cos(heading), np.sin(heading), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    path = gate.position + 2 * np.outer(np.sin(turn), across) + 4 * np.outer(np.cos(turn) - 1, up)
    path += flatness * np.outer(np.sin(turn / 2), np.cross(up, across))
    box = box_around(path, 0.3)
    camera = best_view(path, [gate], box.corners, np.array([6.0, 6.0]))
    assert abs(camera.toward @ gate.normal) > 0.3
    picture = camera.project(path)
    assert np.ptp(picture, axis=0).min() > 0.3 * min(4.0, np.ptp(path[:, 2]))


@examples(25)
@given(st.lists(points, min_size=2, max_size=20).map(np.array), cameras, st.floats(2, 8), st.floats(2, 8))
def test_an_axes_box_holds_everything_and_fits_its_axes_at_equal_scales(inside, camera, width, height):
    assume(np.ptp(inside, axis=0).max() > 0.1)
    box = box_around(inside, 0.2)
    assert (inside >= box.lower).all()
    assert (inside <= box.upper).all()
    axes = blank_axes(width, height)
    draw_axes_box(axes, box, camera)
    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    picture = camera.project(box.corners)
    assert (picture > low).all()
    assert (picture < high).all()
    np.testing.assert_allclose((high - low)[0] / width, (high - low)[1] / height)
    assert {f"{name} [m]" for name in "xyz"} <= {text.get_text() for text in axes.texts}


@given(st.lists(st.floats(0, 10), max_size=12).map(np.array), st.floats(0.01, 1.0))
def test_spread_labels_keep_their_order_and_distance(wanted, pitch):
    places = spread_out(wanted, pitch, -100.0, 100.0)
    order = np.argsort(wanted, kind="stable")
    assert (np.diff(places[order]) >= pitch - 1e-9).all()
    assert places.sum() == pytest.approx(
        wanted.sum(), abs=1e-6
    )  # the least squares move nothing on the whole


@given(st.lists(st.floats(0, 10), min_size=1, max_size=8), st.floats(0.01, 1.0))
def test_labels_with_room_enough_stay_in_place(gaps, pitch):
    wanted = np.cumsum(np.array(gaps) + pitch)
    np.testing.assert_allclose(spread_out(wanted, pitch, 0.0, 1e3), wanted, atol=1e-9)


@given(st.lists(st.floats(-5, 15), min_size=1, max_size=8).map(np.array))
def test_spread_labels_stay_within_their_bounds(wanted):
    places = spread_out(wanted, 1.0, 0.0, 10.0)
    assert places.min() >= -1e-9
    assert places.max() <= 10.0 + 1e-9


def test_numbers_of_many_digits_leave_room_for_the_name_of_their_axis(monkeypatch):
    path = np.array([[5000.0, -3000.0, 1200.0], [5006.0, -3000.0, 1201.0]])
    axes = blank_axes(11.0, 4.0)
    draw_box_around(axes, path, 0.3, path, [])
    require_legible(axes.figure, monkeypatch, fewest=3)
