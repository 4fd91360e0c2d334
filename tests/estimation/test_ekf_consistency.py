"""The filter over flips: as far off as it says, and little; outliers, hand-offs, outages, another's truth."""

from dataclasses import replace
from functools import lru_cache

import mujoco
import numpy as np
import pytest
from scipy.stats import chi2

from aerobat import so3
from aerobat.arrays import Array
from ekf_flights import CONVERGED, RATE, STRIDE, Filtered, Measured, Truth, filtered, flips, measured

FEW, MANY = 2, 50  # flights of a plan
FLIPS = pytest.mark.parametrize(
    ("number", "count"), [(0, FEW), *(pytest.param(k, MANY, marks=pytest.mark.slow) for k in (0, 1))]
)


def poses_of(filter_: Filtered, latency: int = 10) -> slice:
    """The samples at which poses arrive."""
    return slice(STRIDE + latency - 1, None, STRIDE)


def flight_mean(values: Array, freedoms: int) -> tuple[float, float, float]:
    """The mean over flights, and the band that holds it 95 times in 100 at any one instant."""
    low, high = chi2.ppf([0.025, 0.975], freedoms * len(values)) / len(values)
    return float(values.mean()), float(low), float(high)


@pytest.mark.parametrize(
    ("latency", "numbers", "count"),
    [(10, (0,), FEW), *(pytest.param(n, (0, 1), MANY, marks=pytest.mark.slow) for n in (1, 10, 25))],
)
def test_errors_are_as_large_as_the_filter_says_and_small(
    latency: int, numbers: tuple[int, ...], count: int
) -> None:
    """Latencies [ms] of a sample, of one pose's period and of several poses on their way."""
    truths = [flips(number, count) for number in numbers]
    runs = [filtered(truth, measured(truth, seed=k), latency, seed=k) for k, truth in enumerate(truths)]
    samples = min(run.error.shape[1] for run in runs)
    nees = np.concatenate([run.nees[:, :samples] for run in runs])
    nis = np.concatenate([run.states.nis[:, :samples] for run in runs])[:, poses_of(runs[0], latency)]
    assert len(nees) == count * len(numbers)
    for values, freedoms in ((nees, 15), (nis, 6)):
        mean, low, high = flight_mean(values, freedoms)
        assert low < mean < high
        inside = (values.mean(axis=0) > low) & (values.mean(axis=0) < high)
        assert inside.mean() > (0.85 if count > FEW else 0.8)
    if latency <= 10:
        position, attitude = (
            np.hypot.reduce([run.rms(part, CONVERGED) for run in runs]) / len(runs) ** 0.5 for part in (0, 2)
        )
        assert position < 0.001
        assert np.degrees(attitude) < 0.15


@pytest.mark.parametrize(("number", "count"), [pytest.param(0, MANY, marks=pytest.mark.slow), (0, 4)])
def test_outliers_are_rejected_and_true_poses_are_not(number: int, count: int) -> None:
    """One in a hundred, 30 cm off: the filter is as accurate as without."""
    truth = flips(number, count)
    plain = measured(truth)
    rng = np.random.default_rng(7)
    wrong = rng.random(plain.position.shape[:2]) < 0.01
    wrong[:, 0] = False
    direction = rng.normal(size=plain.position.shape)
    off = 0.3 * direction / np.linalg.norm(direction, axis=-1, keepdims=True)
    spoilt = replace(plain, position=plain.position + wrong[..., None] * off)
    run, clean = filtered(truth, spoilt), filtered(truth, plain)
    fused = run.states.accepted[:, poses_of(run)] == 1.0
    arrived = wrong[:, 1 : 1 + fused.shape[1]]
    assert wrong.sum() > 1.2 * count
    assert not fused[arrived].any()
    assert (~fused[~arrived]).mean() < 1e-3
    assert run.states.jumps.max() == 0.0
    assert run.rms(0, CONVERGED) < 1.02 * clean.rms(0, CONVERGED)


def handed_off(truth: Truth, seen: Measured, pose: int) -> tuple[Truth, Measured]:
    """Poses by a second system from one pose on, and the truth in its axes: turned by 2°, 5 cm off there."""
    rng = np.random.default_rng(11)
    axis, offset = rng.normal(size=(2, len(seen.position), 1, 3))
    turn = so3.exp(np.radians(2.0) * axis / np.linalg.norm(axis, axis=-1, keepdims=True))
    offset = 0.05 * offset / np.linalg.norm(offset, axis=-1, keepdims=True)
    centre = truth.position[:, None, STRIDE * pose]

    def moved(position: Array, first: int) -> Array:
        new = so3.rotate(turn, position - centre) + centre + offset
        return np.concatenate([position[:, :first], new[:, first:]], axis=1)

    def turned(q: Array, first: int) -> Array:
        return np.concatenate([q[:, :first], so3.multiply(turn, q)[:, first:]], axis=1)

    first = STRIDE * pose
    velocity = np.concatenate(
        [truth.velocity[:, :first], so3.rotate(turn, truth.velocity)[:, first:]], axis=1
    )
    return (
        replace(
            truth,
            position=moved(truth.position, first),
            velocity=velocity,
            q_world_body=turned(truth.q_world_body, first),
        ),
        replace(seen, position=moved(seen.position, pose), q_world_body=turned(seen.q_world_body, pose)),
    )


@FLIPS
def test_after_a_hand_off_the_filter_is_back_within_three_tenths_of_a_second(number: int, count: int) -> None:
    """In the flip, 5 cm and 2°: taken as one jump, then followed to millimetres and tenths of a degree."""
    truth = flips(number, count)
    pose = truth.omega.shape[1] // STRIDE // 2
    run = filtered(*handed_off(truth, measured(truth), pose))
    back = STRIDE * pose + 3 * RATE // 10
    assert (run.states.jumps[:, -1] == 1.0).all()
    assert run.states.since_pose[:, back:].max() < 0.05
    assert np.linalg.norm(run.error[:, back:, :3], axis=-1).max() < 0.006
    assert np.degrees(np.linalg.norm(run.error[:, back:, 6:9], axis=-1).max()) < 0.5


@FLIPS
def test_a_second_system_that_takes_the_body_itself_for_turned_does_not_lock_the_filter_out(
    number: int, count: int
) -> None:
    """By 2° and 5 cm: its attitudes contradict every specific force, so that it jumps more than once."""
    truth = flips(number, count)
    seen, pose = measured(truth), truth.omega.shape[1] // STRIDE // 2
    wrong = so3.multiply(seen.q_world_body[:, pose:], so3.exp([0.0, np.radians(2.0), 0.0]))
    moved = np.concatenate([seen.position[:, :pose], seen.position[:, pose:] + [0.0, 0.0, 0.05]], axis=1)
    turned = np.concatenate([seen.q_world_body[:, :pose], wrong], axis=1)
    run = filtered(truth, replace(seen, position=moved, q_world_body=turned))
    back = STRIDE * pose + 3 * RATE // 10
    assert run.states.since_pose[:, back:].max() < 0.1
    off = np.linalg.norm(run.error[:, back:, :3] + [0.0, 0.0, 0.05], axis=-1)
    assert off.max() < 0.015


@FLIPS
def test_in_an_outage_the_filter_coasts_as_well_as_it_says_and_is_back_with_the_next_pose(
    number: int, count: int
) -> None:
    """Half a second within the flip."""
    truth = flips(number, count)
    run = filtered(truth, measured(truth), lost=slice(70, 120))
    during = slice(10 * 70 + 10, 10 * 120 + 10 - 1)
    nees, low, high = flight_mean(run.nees[:, during], 15)
    assert low < nees < high
    np.testing.assert_allclose(run.states.since_pose[:, during.stop - 1], 0.519, rtol=0, atol=1e-9)
    assert (run.states.jumps[:, -1] == 0.0).all()
    after = Filtered(run.states, run.error[:, during.stop + 20 :])
    assert after.rms(0) < 0.0015


FREE_BODY = """
<mujoco>
  <option integrator="RK4" timestep="0.0005" gravity="0 0 -9.81"/>
  <worldbody>
    <body name="body">
      <freejoint/>
      <inertial pos="0 0 0" mass="1.3" fullinertia="0.008 0.009 0.014 0.0005 -0.0003 0.0002"/>
      <site name="imu"/>
    </body>
  </worldbody>
  <sensor>
    <gyro site="imu"/>
    <accelerometer site="imu"/>
  </sensor>
</mujoco>
"""


@lru_cache
def tumbling(samples: int = 2000) -> Truth:
    """MuJoCo's free body under a thrust and moments that turn it over and back again, and its own sensors."""
    model = mujoco.MjModel.from_xml_string(FREE_BODY)
    data = mujoco.MjData(model)
    poses, velocities, readings = [data.qpos.copy()], [data.qvel[:3].copy()], []
    for k in range(samples):
        t = k / RATE
        moment = [0.9 * np.sin(9.0 * t), 0.5 * np.cos(6.0 * t + 1.0), 0.2 * np.sin(4.0 * t)]
        frame = so3.axes(data.qpos[3:])
        data.xfrc_applied[1] = np.concatenate([frame[:, 2] * (16.0 + 10.0 * np.sin(3.0 * t)), frame @ moment])
        mujoco.mj_forward(model, data)
        reading = [data.sensordata.copy()]
        for _ in range(2):
            mujoco.mj_step(model, data)
            mujoco.mj_forward(model, data)
            reading.append(data.sensordata.copy())
        readings.append((reading[0] + 4.0 * reading[1] + reading[2]) / 6.0)
        poses.append(data.qpos.copy())
        velocities.append(data.qvel[:3].copy())
    qpos, means = np.array(poses), np.array(readings)
    return Truth(
        qpos[None, :, :3],
        np.array(velocities)[None],
        qpos[None, :, 3:],
        means[None, :, :3],
        means[None, :, 3:],
    )


@pytest.mark.slow
def test_on_a_motion_by_mujoco_the_filter_is_as_accurate() -> None:
    """Forty draws of the sensors' errors on one motion."""
    one = tumbling()
    truth = Truth(*(np.repeat(part, 40, axis=0) for part in vars(one).values()))
    run = filtered(truth, measured(truth, seed=5))
    for values, freedoms in ((run.nees, 15), (run.states.nis[:, poses_of(run)], 6)):
        mean, low, high = flight_mean(values, freedoms)
        assert low < mean < high
    assert run.rms(0, CONVERGED) < 0.001
    assert np.degrees(run.rms(2, CONVERGED)) < 0.15
