"""Trajectories for the Crazyflie: bytes, paths and attitudes as its firmware reads and derives them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import aerobat as ab
from aerobat.interchange.exports.crazyflie import MAX_EXTENT, MAX_PIECES, PIECE
from aerobat.interchange.exports.heading import fit_yaw
from aerobat.interchange.exports.loss import peak_difference
from aerobat.interchange.exports.refit import refit
from shared_plans import shared_plan
from suites import examples

MEMORY = 4096  # bytes
# one piece packed by cflib 0.1.34: axis i has the coefficients (1 + i) (k - 2.7)/3 of the powers k, 0.4375 s
PACKED = (
    "666666bf111111bfefee6ebecdcccc3ddedddd3e4444443fcdcc8c3f7777b73f6666e6bf111191bfefeeeebe"
    "cdcc4c3ededd5d3f4444c43fcdcc0c4077773740cdcc2cc09a99d9bf333333bf9a99993e6666a63f33331340"
    "333353409a998940666666c0111111c0efee6ebfcdcccc3ededddd3f44444440cdcc8c407777b7400000e03e"
)


@pytest.fixture(scope="module")
def flip() -> ab.Plan:
    """The flip with translation."""
    return shared_plan("flip-roll-translation")


def evaluated(path: Path, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, Rotation, Rotation]:
    """Position, velocity, attitude and thrust axis by the CSV, derived as the firmware does."""
    table = np.loadtxt(path, delimiter=",", skiprows=1, usecols=range(33))
    ends = np.cumsum(table[:, 0])
    piece = np.minimum(np.searchsorted(ends, times, side="right"), len(table) - 1)
    local = times - (ends - table[:, 0])[piece]
    coefficients = table[piece, 1:].reshape(-1, 4, 8)
    powers = np.arange(8)
    flat = []
    for _ in range(3):
        flat.append((coefficients * local[:, None, None] ** powers).sum(axis=-1))
        coefficients = np.concatenate(
            [(coefficients * powers)[..., 1:], np.zeros((len(times), 4, 1))], axis=-1
        )
    position, velocity, acceleration = (each[:, :3] for each in flat)
    yaw = flat[0][:, 3]
    thrust = acceleration + np.array([0.0, 0.0, 9.81])
    z_body = thrust / np.linalg.norm(thrust, axis=1, keepdims=True)
    x_world = np.stack([np.cos(yaw), np.sin(yaw), np.zeros(len(times))], axis=1)
    y_body = np.cross(z_body, x_world)
    y_body /= np.linalg.norm(y_body, axis=1, keepdims=True)
    axes = np.stack([np.cross(y_body, z_body), y_body, z_body], axis=-1)
    return position, velocity, Rotation.from_matrix(axes), z_body


def test_the_translating_flip_fits_and_is_what_the_firmware_reads(flip: ab.Plan, tmp_path: Path) -> None:
    made = ab.export(flip, tmp_path / "flip", "crazyflie")
    memory = (tmp_path / "flip" / "trajectory.bin").read_bytes()
    assert len(memory) <= MEMORY
    assert len(memory) % 132 == 0
    table = np.loadtxt(tmp_path / "flip" / "trajectory.csv", delimiter=",", skiprows=1)
    words = np.frombuffer(memory, "<f4").reshape(-1, 33)  # struct poly4d { float p[4][8]; float duration; }
    np.testing.assert_array_equal(words, np.roll(table, -1, axis=1).astype(np.float32))
    assert made.loss.position < 2e-3


@pytest.mark.parametrize("heading", [-0.7, 0.4])
def test_the_firmware_flies_the_plan_within_the_stated_loss(
    heading: float, flip: ab.Plan, tmp_path: Path
) -> None:
    turned = replace(flip, trajectory=replace(flip.trajectory, heading=heading))
    made = ab.export(turned, tmp_path / "flip", "crazyflie")
    times = np.linspace(0.0, flip.duration - 1e-5, 3000)
    position, velocity, attitude, z_body = evaluated(tmp_path / "flip" / "trajectory.csv", times)
    planned = ab.reference(turned, times=times).setpoint
    turns = Rotation.from_quat(planned.q_world_body[:, [1, 2, 3, 0]])
    assert np.linalg.norm(position - planned.flat.position, axis=1).max() <= made.loss.position + 1e-9
    assert np.linalg.norm(velocity - planned.flat.velocity, axis=1).max() <= made.loss.velocity + 1e-9
    assert (turns.inv() * attitude).magnitude().max() <= made.loss.attitude + 1e-7
    apart = np.cross(turns.apply([0.0, 0.0, 1.0]), z_body)
    assert np.linalg.norm(apart, axis=1).max() <= made.loss.thrust_axis + 1e-7
    assert made.loss.thrust_axis < 1e-3


@examples(16)
@given(seed=st.integers(0, 2**32 - 1), heading=st.just(0.0) | st.floats(-3.1, 3.1), planar=st.booleans())
def test_any_tumble_is_fitted_and_its_loss_bounds_what_is_seen(
    seed: int, heading: float, planar: bool, flip: ab.Plan, tmp_path_factory: pytest.TempPathFactory
) -> None:
    rng = np.random.default_rng(seed)
    inputs = 400.0 * rng.normal(size=(8, 3)) * [1.0, not planar, 1.0]
    tumble = ab.Trajectory.from_inputs(np.zeros((4, 3)), inputs, 0.2, heading)
    assume(np.abs(tumble.component_range(0)).max() <= MAX_EXTENT)
    plan = replace(flip, trajectory=tumble)
    folder = tmp_path_factory.mktemp("tumble") / "x"
    made = ab.export(plan, folder, "crazyflie")
    times = np.linspace(0.0, tumble.duration - 1e-5, 700)
    _, _, attitude, _ = evaluated(folder / "trajectory.csv", times)
    turns = Rotation.from_quat(ab.reference(plan, times=times).setpoint.q_world_body[:, [1, 2, 3, 0]])
    assert (turns.inv() * attitude).magnitude().max() <= made.loss.attitude + 1e-3
    assert made.loss.thrust_axis <= made.loss.attitude + 1e-9


@pytest.mark.parametrize("excess", [0.0, 1e-9, 1e-8, 1e-6])
def test_yaw_is_fitted_where_a_piece_ends_with_the_thrust_all_but_along_the_heading(
    excess: float, flip: ab.Plan
) -> None:
    """There the attitude depends on yaw without bound, or not at all."""
    cube = np.array([-9.81 / 6.0, 0.0, -9.81 / 6.0]) * (1.0 + excess)  # from a hover to a thrust along -x
    path = ab.Trajectory([1.0], [[[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], cube]])
    coefficients, _, thrust_axis_error = fit_yaw(replace(flip, trajectory=path), path)
    yaw = np.linspace(0.0, 1.0, 50)[:, None] ** np.arange(8) @ coefficients[0]
    assert np.abs(yaw).max() < 0.05  # [rad] of the plan's, which is 0
    assert thrust_axis_error < 1e-6


def test_a_flip_about_the_bodys_own_x_loses_no_heading(tmp_path: Path) -> None:
    made = ab.export(shared_plan("flip-roll"), tmp_path / "flip", "crazyflie")
    assert made.loss.attitude < np.deg2rad(0.05)


def test_a_piece_has_the_bytes_that_cflib_packs() -> None:
    """With the numbers of a CSV `tests/crazyflie_peer.py` does the same, in an environment that has cflib."""
    piece = np.zeros(1, dtype=PIECE)
    piece["polynomials"] = np.arange(1, 5)[:, None] * (np.arange(8) - 2.7) / 3
    piece["duration"] = 0.4375
    assert piece.tobytes() == bytes.fromhex(PACKED)


@pytest.mark.slow
@examples(4)
@given(seed=st.integers(0, 2**32 - 1), segments=st.integers(32, 48), degree=st.sampled_from([4, 5, 9]))
def test_a_refit_has_few_pieces_that_join_as_smoothly_as_the_path(
    seed: int, segments: int, degree: int
) -> None:
    rng = np.random.default_rng(seed)
    initial = 2.0 * rng.normal(size=(degree, 3)) / 3.0 ** np.arange(degree)[:, None]
    inputs = rng.normal(size=(segments, 3))
    path = ab.Trajectory.from_inputs(initial, inputs, rng.uniform(0.05, 0.15, size=segments))
    fitted = refit(path, MAX_PIECES)
    assert fitted.segments <= MAX_PIECES
    assert fitted.degree <= 7
    assert fitted.duration == pytest.approx(path.duration, rel=1e-12)
    assert peak_difference(path, 0, fitted) < 1e-3
    for derivative in range(4):
        scale = 1.0 + path.peak(derivative).value
        assert fitted.jumps(derivative).max() < path.jumps(derivative).max() + 1e-9 * scale


def test_a_path_that_is_such_pieces_already_stays_as_it_is() -> None:
    path = ab.Trajectory.from_inputs(np.zeros((5, 3)), np.ones((20, 3)), 0.1)
    assert refit(path, MAX_PIECES) is path


def test_fewer_pieces_cost_more_and_still_little(flip: ab.Plan) -> None:
    errors = [peak_difference(flip.trajectory, 0, refit(flip.trajectory, pieces)) for pieces in (20, 14, 10)]
    assert errors == sorted(errors)
    assert errors[0] < 1e-3
    assert errors[-1] < 5e-2


def test_what_31_pieces_do_not_follow_and_what_is_far_away_is_refused(flip: ab.Plan, tmp_path: Path) -> None:
    places = np.random.default_rng(0).uniform(-5.0, 5.0, size=(200, 1, 3))
    wild = ab.minimum_effort(
        np.concatenate([places, np.full((200, 2, 3), np.nan)], axis=1), np.full(199, 0.3)
    )
    moved = flip.trajectory.coefficients.copy()
    moved[:, 0] += 200.0
    far = ab.Trajectory(flip.trajectory.durations, moved)
    with pytest.raises(ab.SpecError, match="31 pieces of degree 7"):
        ab.export(replace(flip, trajectory=wild), tmp_path / "x", "crazyflie")
    with pytest.raises(ab.SpecError, match="100 m"):
        ab.export(replace(flip, trajectory=far), tmp_path / "x", "crazyflie")
    assert not (tmp_path / "x").exists()


def test_a_piece_that_goes_far_away_between_its_ends_is_refused(flip: ab.Plan, tmp_path: Path) -> None:
    there_and_back = np.zeros((1, 3, 3))
    there_and_back[0, :, 0] = (0.0, 600.0, -600.0)  # 150 m away at half of the time
    path = ab.Trajectory([60.0], there_and_back)
    with pytest.raises(ab.SpecError, match="100 m of the origin along each axis, and this one reaches 150 m"):
        ab.export(replace(flip, trajectory=path), tmp_path / "x", "crazyflie")
    assert not (tmp_path / "x").exists()
