"""Motion capture: noise, gaps and outliers as stated, a hand-off that is an exact transform, and latency."""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

import aerobat as ab
from aerobat import so3
from aerobat.engines.floats import ArrayOps
from aerobat.engines.pytree import components, from_components
from aerobat.environment import Dispersion, HandOff, Imu, MotionCapture, Outage
from aerobat.errors import SpecError
from aerobat.kernels import mocap
from aerobat.kernels.mocap import PoseSample
from aerobat.kernels.rigid_body import Pose
from aerobat.simulation.conditions.parts import hand_off_plane
from aerobat.simulation.conditions.sensors import MocapState, MotionCaptureSensor
from aerobat.simulation.loop import due_ticks
from dispersed_loops import RATE, dispersed_setup, drawn, rows_of
from looping_flights import QUAD, loops

FLIGHTS = 64
WALL = HandOff((0.3, 0.0, 0.0), (1.0, 0.0, 0.0), translation=0.05, rotation=np.radians(2.0))
places = st.tuples(*(st.floats(-2.0, 2.0),) * 3).map(np.array)


class Seen(NamedTuple):
    delivered: PoseSample
    body: Any


def log(signals: Any) -> Seen:
    return Seen(signals.of(MocapState).delivered, signals.plant.body)


def with_capture(**errors: Any) -> Dispersion:
    return Dispersion(imu=Imu(), motion_capture=MotionCapture(**errors))


def sensor_of(dispersion: Dispersion, flights: int = 1) -> Any:
    """The sensor and its parameters."""
    setup = dispersed_setup(loops(1.0), QUAD, dispersion, drawn(dispersion, QUAD, flights))
    [part] = (part for part in setup.parts if isinstance(part.component, MotionCaptureSensor))
    return part.component, part.parameters


def seen_by(dispersion: Dispersion, flights: int = FLIGHTS) -> tuple[np.ndarray, ...]:
    """Of every exposure of some flights: position error, attitude error, whether it is valid, its time."""
    engine = "compiled"
    setup = dispersed_setup(loops(2.0), QUAD, dispersion, drawn(dispersion, QUAD, flights), engine=engine)
    rows = rows_of(setup, log)
    at = slice(0, 2001, 10)
    position, q, valid, true_position, true_q = (
        from_components(part)[:, at] if isinstance(part, tuple) else part[:, at]
        for part in (*rows.delivered.pose, rows.delivered.is_valid, *rows.body[::2])
    )
    return position - true_position, so3.box_minus(q, true_q), valid, setup.times[at]


def test_without_errors_a_pose_is_the_pose() -> None:
    position, attitude, valid, _ = seen_by(with_capture(), 2)
    assert np.abs(position).max() < 1e-15
    assert np.abs(attitude).max() < 1e-15
    assert (valid == 1.0).all()


def test_noise_is_normal_with_the_spread_stated() -> None:
    position, attitude, _, _ = seen_by(with_capture(position_noise=0.001, attitude_noise=0.005))
    for errors, spread in ((position, 0.001), (attitude, 0.005)):
        for axis in errors.reshape(-1, 3).T:
            assert stats.kstest(axis / spread, "norm").pvalue > 1e-3


def test_dropouts_and_outliers_come_at_the_rate_stated() -> None:
    position, _, valid, _ = seen_by(with_capture(dropout=0.1, outlier=0.05, outlier_size=0.3))
    is_outlier = (position != 0.0).any(axis=-1) & (np.abs(position) > 1e-9).any(axis=-1)
    assert stats.binomtest(int((valid == 0.0).sum()), valid.size, 0.1).pvalue > 1e-3
    assert stats.binomtest(int(is_outlier.sum()), valid.size, 0.05).pvalue > 1e-3
    assert stats.kstest(position[is_outlier].ravel() / 0.3, "norm").pvalue > 1e-3


def test_nothing_is_seen_during_an_outage_and_all_before_and_after() -> None:
    _, _, valid, times = seen_by(with_capture(outage=Outage(0.5, 0.25)), 2)
    is_out = (times >= 0.5) & (times < 0.75)
    np.testing.assert_array_equal(valid, np.tile(~is_out, (2, 1)))


@pytest.mark.parametrize("latency", [0, 3, 10, 25, 79])
def test_a_pose_arrives_its_latency_after_its_exposure(latency: int) -> None:
    dispersion = with_capture(latency=latency / RATE)
    sensor, _ = sensor_of(dispersion)
    setup = dispersed_setup(loops(1.0), QUAD, dispersion, drawn(dispersion, QUAD, 1))
    rows = rows_of(setup, log)
    delivered, true = (from_components(part)[0] for part in (rows.delivered.pose[0], rows.body.position))
    ticks = np.arange(len(setup.times))
    arrivals = ticks[due_ticks(sensor.period, 0, len(ticks), sensor.latency) > 0.0]
    np.testing.assert_array_equal(arrivals, np.arange(latency, len(ticks), 10))
    np.testing.assert_allclose(delivered[arrivals], true[arrivals - latency], atol=1e-15)
    assert not rows.delivered.is_valid[0, : latency - latency % 10].any()
    assert rows.delivered.is_valid[0, arrivals].all()


def test_a_latency_of_many_periods_is_refused_in_a_sentence() -> None:
    with pytest.raises(
        SpecError, match=r"^motion_capture.latency must be below 8 periods .* 0.08 s, got 0.08 s$"
    ):
        sensor_of(with_capture(latency=0.08))


def test_a_rate_that_does_not_fit_the_ticks_is_refused_in_a_sentence() -> None:
    sentence = (
        r"^motion_capture.rate must be the simulation's rate \(1000 1/s\) over a whole number, got 300$"
    )
    with pytest.raises(SpecError, match=sentence):
        sensor_of(with_capture(rate=300.0))


@cache
def hand_off_of(hand_off: HandOff) -> Any:
    return sensor_of(with_capture(hand_off=hand_off))[1].hand_off


def as_seen(hand_off: Any, position: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    pose = mocap.as_seen(ArrayOps, hand_off, Pose(components(position), components(q)))
    return from_components(pose.position), from_components(pose.q_world_body)


@given(places, places)
def test_beyond_the_plane_poses_are_turned_and_moved_exactly_before_it_not_at_all(
    position: np.ndarray, turn: np.ndarray
) -> None:
    columns = drawn(with_capture(hand_off=WALL), QUAD, 1).columns
    q = so3.exp(turn)
    seen, seen_q = as_seen(hand_off_of(WALL), position[None], q[None])
    point, rotation = np.array([0.3, 0.0, 0.0]), so3.exp(columns["hand_off_rotation"][0])
    moved = point + so3.rotate(rotation, position - point) + columns["hand_off_translation"][0]
    is_beyond = position[0] > 0.3
    np.testing.assert_allclose(seen[0], moved if is_beyond else position, atol=1e-12)
    np.testing.assert_allclose(seen_q[0], so3.multiply(rotation, q) if is_beyond else q, atol=1e-12)


def test_at_the_plane_s_point_a_pose_jumps_by_5_cm_and_2_degrees() -> None:
    sides = np.array([[0.3 - 1e-9, 0.0, 0.0], [0.3 + 1e-9, 0.0, 0.0]])
    seen, q = as_seen(hand_off_of(WALL), sides, np.tile(so3.IDENTITY, (2, 1)))
    assert np.linalg.norm(seen[1] - seen[0]) == pytest.approx(0.05, abs=1e-8)
    assert so3.angle_between(*q) == pytest.approx(np.radians(2.0), abs=1e-8)


@given(places, st.tuples(*(st.floats(-1e-3, 1e-3),) * 3).map(np.array))
def test_off_the_plane_neighbours_are_seen_as_neighbours(position: np.ndarray, step: np.ndarray) -> None:
    """A rotation keeps lengths, and a warp of w over a depth d changes by w/(d √e) a metre at most."""
    hand_off = HandOff(WALL.point, WALL.normal, 0.05, 0.03, warp=0.02, warp_depth=0.5)
    other = position + step
    if (position[0] > 0.3) == (other[0] > 0.3):
        seen, _ = as_seen(hand_off_of(hand_off), np.array([position, other]), np.tile(so3.IDENTITY, (2, 1)))
        change, limit = np.linalg.norm(seen[1] - seen[0]), np.linalg.norm(step)
        assert abs(change - limit) <= limit * 0.02 / (0.5 * np.sqrt(np.e)) + 1e-14


def test_the_warp_is_largest_at_the_plane_and_gone_far_from_it() -> None:
    hand_off = HandOff((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), warp=0.02, warp_depth=0.5)
    line = np.array([[0.0, y, 0.0] for y in (-5.0, -0.5, 0.0, 0.5, 5.0)])
    seen, _ = as_seen(hand_off_of(hand_off), line, np.tile(so3.IDENTITY, (5, 1)))
    sizes = np.linalg.norm(seen - line, axis=1)
    np.testing.assert_allclose(sizes, 0.02 * np.exp([-50.0, -0.5, 0.0, -0.5, -50.0]), atol=1e-12)


def test_a_hand_off_lies_in_the_gate_or_half_way_unless_it_says_where() -> None:
    gates = ab.load_problem("half-flip").gates
    line = ab.plan("line", vehicle="agile-quad").trajectory
    point, normal = hand_off_plane(HandOff(), line, gates)
    np.testing.assert_array_equal(point, gates[0].position)
    np.testing.assert_array_equal(normal, gates[0].normal)
    _, normal = hand_off_plane(HandOff(normal=(0.0, 0.0, 2.0)), line, gates)
    np.testing.assert_array_equal(normal, [0.0, 0.0, 1.0])
    point, normal = hand_off_plane(HandOff(), line, ())
    np.testing.assert_array_equal(point, line.evaluate(0.5 * line.duration, 0))
    velocity = line.evaluate(0.5 * line.duration, 1)
    np.testing.assert_allclose(normal, velocity / np.linalg.norm(velocity), atol=1e-12)
