"""Recorded logs through the filter: as it ran on board, poses late and out of order, gaps, and wrong logs."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from aerobat import so3
from aerobat.arrays import Array
from aerobat.errors import SpecError
from aerobat.estimation import Ekf, Estimates, SensorLog, estimate
from aerobat.estimation.sensor_log import MAX_AGE
from ekf_flights import RATE, STRIDE, Truth, filtered, flips, measured

KNOWN_START = Ekf(start_velocity=0.0)


def true_flips() -> Truth:
    """A few flips, of which one is looked at."""
    return flips(1, 2)


def log_of(latency: float = 0.010, **changes: Any) -> SensorLog:
    """What one vehicle's sensors have shown in a flip."""
    seen = measured(true_flips())
    exposures = np.arange(seen.position.shape[1]) * STRIDE / RATE
    arrays = {
        "imu_times": np.arange(1, seen.omega.shape[1] + 1) / RATE,
        "omega": seen.omega[0],
        "specific_force": seen.specific_force[0],
        "pose_times": exposures,
        "position": seen.position[0],
        "q_world_body": seen.q_world_body[0],
        "arrival_times": (np.arange(len(exposures)) * STRIDE + latency * RATE) / RATE,
    }
    return SensorLog(**(arrays | changes))


def estimates_of(log: SensorLog) -> Estimates:
    return estimate(log, KNOWN_START, start_velocity=true_flips().velocity[0, 0])


def errors(estimates: Estimates) -> tuple[Array, Array]:
    """Vectors to the truth [m], and angles [rad]."""
    truth = true_flips()
    at = np.round(estimates.times * RATE).astype(int)
    return (
        truth.position[0, at] - estimates.position,
        so3.angle_between(truth.q_world_body[0, at], estimates.q_world_body),
    )


def assert_consistent(estimates: Estimates) -> None:
    """The poses' NIS within the band of 999 in 1000, and the errors small."""
    nis = estimates.nis[np.isfinite(estimates.nis)]
    low, high = chi2.ppf([0.0005, 0.9995], 6 * len(nis)) / len(nis)
    assert low < nis.mean() < high
    position, attitude = errors(estimates)
    assert np.sqrt((position[200:] ** 2).sum(axis=-1).mean()) < 0.0015
    assert np.degrees(np.sqrt((attitude[200:] ** 2).mean())) < 0.15


def test_a_replayed_log_gives_what_the_filter_had_on_board() -> None:
    log, truth = log_of(), true_flips()
    on_board = filtered(truth, measured(truth), settings=KNOWN_START).states
    again = estimates_of(log)
    np.testing.assert_array_equal(again.times, log.imu_times)
    for name in ("position", "velocity", "q_world_body", "gyro_bias", "accelerometer_bias"):
        wanted = np.stack([leaf[0] for leaf in getattr(on_board.nominal, name)], axis=-1)
        np.testing.assert_allclose(getattr(again, name), wanted, rtol=0, atol=1e-9)
    variances = [on_board.covariance[i][0] for i in (0, 15, 29, 119)]
    np.testing.assert_allclose(again.sigma[:, [0, 1, 2, 14]], np.sqrt(np.transpose(variances)), rtol=1e-6)
    np.testing.assert_allclose(again.omega_body, log.omega - again.gyro_bias, rtol=0, atol=0)
    arrived = again.nis[1:-1]
    np.testing.assert_allclose(arrived, on_board.nis[0, 2 * STRIDE - 1 :: STRIDE][: len(arrived)], rtol=1e-6)


@pytest.mark.parametrize("latency", [0.0, 0.0137, 0.040], ids="{} s".format)
def test_poses_of_any_age_are_fused_at_their_own_time(latency: float) -> None:
    log = log_of(latency)
    estimates = estimates_of(log)
    assert_consistent(estimates)
    assert estimates.accepted[0]
    late = log.arrivals > log.imu_times[-1]
    np.testing.assert_array_equal(np.isnan(estimates.nis[1:]), late[1:])
    assert not estimates.accepted[1:][late[1:]].any()


def test_poses_between_samples_that_arrive_out_of_order_are_fused_as_well() -> None:
    """Samples of 500 Hz, exposures half-way, every second pose 20 ms later than the next one."""
    log = log_of()
    pairs = len(log.imu_times) // 2
    odd = 5 + STRIDE * np.arange(160)
    truth, rng = true_flips(), np.random.default_rng(2)
    exposures = odd / RATE
    turns = so3.exp(Ekf().attitude_noise * rng.normal(size=(160, 3)))
    mixed = SensorLog(
        imu_times=log.imu_times[1 : 2 * pairs : 2],
        omega=log.omega[: 2 * pairs].reshape(pairs, 2, 3).mean(axis=1),
        specific_force=log.specific_force[: 2 * pairs].reshape(pairs, 2, 3).mean(axis=1),
        pose_times=exposures,
        position=truth.position[0, odd] + 0.001 * rng.normal(size=(160, 3)),
        q_world_body=so3.multiply(truth.q_world_body[0, odd], turns),
        arrival_times=exposures + np.where(np.arange(160) % 2, 0.005, 0.025),
    )
    assert (np.diff(mixed.arrivals) < 0.0).any()
    assert_consistent(estimate(mixed, KNOWN_START, start_velocity=truth.velocity[0, 5]))


def test_an_outage_is_said_from_when_to_when_and_its_errors_are_stated() -> None:
    log = log_of()
    kept = (log.pose_times < 0.7) | (log.pose_times > 1.1)
    estimates = estimates_of(
        log_of(
            pose_times=log.pose_times[kept],
            position=log.position[kept],
            q_world_body=log.q_world_body[kept],
            arrival_times=log.arrivals[kept],
        )
    )
    (gap,) = estimates.coasting
    assert (gap.start, gap.end) == pytest.approx((0.69, 1.12), abs=0.0015)
    assert "without poses from 0.690 to 1.1" in str(estimates)
    during = (estimates.times > 0.75) & (estimates.times < 1.11)
    assert (np.diff(estimates.sigma[during, :3], axis=0) > 0.0).all()
    assert (np.abs(errors(estimates)[0][during]) < 4.0 * estimates.sigma[during, :3]).all()
    assert estimates_of(log).coasting == ()
    to_the_end = log_of(
        pose_times=log.pose_times[:100],
        position=log.position[:100],
        q_world_body=log.q_world_body[:100],
        arrival_times=log.arrivals[:100],
    )
    assert estimates_of(to_the_end).coasting[0].end == log.imu_times[-1]


def test_poses_that_are_late_one_after_another_leave_no_gap() -> None:
    """Of 160 ms, longer than a gap, each; it was said to be without poses all the time."""
    late = estimates_of(log_of(0.160))
    assert late.coasting == ()
    assert "without poses" not in str(late)


def test_what_became_of_each_pose_is_told() -> None:
    """One outlier, then a jump that stays."""
    log = log_of()
    spoilt = log.position.copy()
    spoilt[40] += 0.3
    spoilt[100:] += 0.05
    estimates = estimates_of(replace(log, position=spoilt))
    assert np.flatnonzero(~estimates.accepted).tolist() == [40, 100, 101, 102, 103, len(log.pose_times) - 1]
    np.testing.assert_allclose(estimates.jumps, [log.arrivals[104]], rtol=0, atol=1e-9)
    fused = len(log.pose_times) - 2  # the first is where it begins, the last is not heard before the log ends
    told = f"{log.imu_times[-1] - log.imu_times[0]:.3f} s with {fused} poses, 5 rejected, jumps at 1.050 s"
    assert str(estimates) == told


def test_a_long_log_is_run_in_pieces_that_change_nothing(monkeypatch) -> None:
    whole = estimates_of(log_of())
    monkeypatch.setattr("aerobat.estimation.replay._ROWS", 137)
    assert estimates_of(log_of()) == whole


def test_a_filter_of_sensors_reckons_with_their_noise() -> None:
    from aerobat.environment import load_dispersion

    lab = load_dispersion("lab")
    assert lab.imu is not None
    assert lab.motion_capture is not None
    assert Ekf.of_sensors(lab.imu, lab.motion_capture) == Ekf()
    exact = Ekf.of_sensors(type(lab.imu)(), type(lab.motion_capture)())
    assert (exact.gyro_noise, exact.position_noise, exact.attitude_noise) == (0.0, 1e-4, 1e-3)


def small_log(**changes: Any) -> SensorLog:
    """Ten samples and three poses of a vehicle at rest."""
    arrays = {
        "imu_times": np.arange(10) / 100,
        "omega": np.zeros((10, 3)),
        "specific_force": np.tile([0.0, 0.0, 9.81], (10, 1)),
        "pose_times": [0.0, 0.03, 0.06],
        "position": np.zeros((3, 3)),
        "q_world_body": np.tile(so3.IDENTITY, (3, 1)),
    }
    return SensorLog(**(arrays | changes))


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"omega": np.full((10, 3), np.nan)}, "omega must be numbers; it contains a NaN"),
        (
            {"omega": np.zeros((10, 2))},
            "omega must have the shape (10, 3), a row for each of imu_times, got (10, 2)",
        ),
        (
            {"position": np.zeros(3)},
            "position must have the shape (3, 3), a row for each of pose_times, got (3,)",
        ),
        (
            {"imu_times": np.zeros(10)},
            "imu_times must be one series of rising times; sort it and drop repetitions",
        ),
        (
            {"pose_times": np.zeros((3, 1))},
            "pose_times must be one series of rising times; sort it and drop repetitions",
        ),
        ({"imu_times": "now"}, "SensorLog: imu_times must be numbers, got 'now'"),
        (
            {"q_world_body": np.ones((3, 4))},
            "q_world_body must be unit quaternions (w, x, y, z); that of pose 0 is of the norm 2",
        ),
        (
            {"arrival_times": [0.0, 0.02, 0.07]},
            "arrival_times must be 0 to 0.2 s after pose_times, got -0.01 s for pose 1; "
            "set both to one clock",
        ),
        ({"arrival_times": [0.1]}, "arrival_times must have the shape (3,), got (1,)"),
        (
            {"imu_times": [*np.arange(9) / 100, 0.2]},
            "imu_times has a gap of 0.12 s at 0.08 s; above 0.05 s cut the log",
        ),
        (
            {"imu_times": [0.0], "omega": np.zeros((1, 3)), "specific_force": np.zeros((1, 3))},
            "a log needs two samples of the IMU and a pose, got 1 and 3",
        ),
    ],
)
def test_a_wrong_log_is_refused_in_a_sentence(changes: dict[str, Any], sentence: str) -> None:
    assert estimate(small_log()).accepted.all()
    with pytest.raises(SpecError) as caught:
        small_log(**changes)
    assert str(caught.value) == sentence


def test_poses_may_arrive_at_once_or_as_late_as_the_limit() -> None:
    arrivals = [0.0, 0.03 + 0.5 * MAX_AGE, 0.06 + np.nextafter(MAX_AGE, 0.0)]
    assert small_log(arrival_times=arrivals).arrivals.tolist() == arrivals
    latest = [MAX_AGE, *arrivals[1:]]
    assert small_log(arrival_times=latest).arrivals.tolist() == latest
    for too_late in (-1e-9, np.nextafter(MAX_AGE, 1.0)):
        with pytest.raises(SpecError, match="set both to one clock"):
            small_log(arrival_times=[too_late, *arrivals[1:]])


def test_a_log_whose_clocks_have_nothing_in_common_is_refused() -> None:
    sentence = "pose_times has none from -0.01 to 0.09 s, where the IMU's samples are; set both to one clock"
    with pytest.raises(SpecError) as caught:
        estimate(small_log(pose_times=[5.0, 5.1, 5.2]))
    assert str(caught.value) == sentence
