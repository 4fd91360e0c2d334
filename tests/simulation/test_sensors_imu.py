"""An IMU's samples: means that give back a flip, noise of the density stated, biases that walk, a range."""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest

import aerobat as ab
from aerobat import so3
from aerobat.engines.engine import expanded
from aerobat.engines.floats import ArrayOps
from aerobat.engines.pytree import from_components
from aerobat.environment import Dispersion, Imu, MotionCapture
from aerobat.kernels import imu
from aerobat.kernels.imu import BiasParameters, ImuParameters, ImuSample, ImuState
from aerobat.simulation.conditions.draw import Draws
from aerobat.simulation.conditions.random_source import RandomSource
from aerobat.simulation.conditions.sensors import IMU_NOISE
from dispersed_loops import RATE, dispersed_setup, drawn, rows_of

QUAD = ab.load_vehicle("agile-quad")
DENSITY, WALK = 1e-3, 2e-4


class Felt(NamedTuple):
    sample: ImuSample
    body: Any


def log(signals: Any) -> Felt:
    return Felt(signals.of(ImuState).sample, signals.plant.body)


def with_imu(**errors: float) -> Dispersion:
    return Dispersion(imu=Imu(**errors), motion_capture=MotionCapture())


@cache
def flip_plan() -> ab.Plan:
    return ab.plan("flip-roll", vehicle=QUAD)


def flip(dispersion: Dispersion) -> tuple[Any, ...]:
    """Samples and truth of a flip in roll: means of ω and f; v, q and ω at the ticks, each (ticks, ·)."""
    rows = rows_of(dispersed_setup(flip_plan(), QUAD, dispersion, drawn(dispersion, QUAD, 1)), log)
    parts = (*rows.sample, *rows.body[1:])
    return tuple(from_components(part)[0] for part in parts)


def test_samples_of_a_flip_without_errors_give_back_its_turn_and_its_velocity() -> None:
    """Strapdown integration, attitude at the middle of each interval: 0.0001° and 0.1 mm/s after the flip."""
    omega, force, velocity, q, _ = flip(with_imu())
    attitude, speed, dt = q[0], velocity[0], 1.0 / RATE
    for k in range(1, len(q) - 1):  # the last interval is cut short
        half = so3.exp(0.5 * dt * omega[k])
        middle = so3.multiply(attitude, half)
        speed = speed + dt * (so3.rotate(middle, force[k]) - [0.0, 0.0, 9.81])
        attitude = so3.multiply(middle, half)
    assert np.linalg.norm(omega, axis=1).sum() * dt > 2 * np.pi
    assert np.degrees(so3.angle_between(attitude, q[-2])) < 1e-4
    assert np.linalg.norm(speed - velocity[-2]) < 1e-4


def test_a_sample_is_its_interval_s_mean_and_the_instant_s_would_be_off_by_more_than_the_noise() -> None:
    omega, _, _, q, instants = flip(with_imu())
    truth = so3.box_minus(q[1:-1], q[:-2]) * RATE
    noise = DENSITY * np.sqrt(RATE)
    assert np.abs(omega[1:-1] - truth).max() < 0.2 * noise
    assert np.abs(instants[1:-1] - truth).max() > 2.0 * noise


def measured(parameters: ImuParameters, felt: ImuSample, noise: ImuSample) -> ImuSample:
    nothing = ImuSample((0.0,) * 3, (0.0,) * 3)
    return imu.step(ArrayOps, parameters, imu.init(), felt, nothing, noise).sample


def noise_of(ticks: int, vehicles: int, stream: str = "imu") -> ImuSample:
    draws = Draws(Dispersion(), 4, 1, range(vehicles))
    noise: ImuSample = expanded(RandomSource(draws.stream(stream), IMU_NOISE).chunk(0, ticks))
    return noise


def test_white_noise_has_the_density_stated() -> None:
    """The Allan deviation of white noise of density N is N/√τ at any τ."""
    ticks = 2**15
    parameters = ImuParameters(DENSITY * np.sqrt(RATE), 20.0 * DENSITY * np.sqrt(RATE), np.inf, np.inf)
    still = ImuSample((0.0, 0.0, 0.0), (0.0, 0.0, 9.81))
    sample = measured(parameters, still, noise_of(ticks, 4))
    for values, density in ((sample.omega, DENSITY), (sample.specific_force, 20.0 * DENSITY)):
        for averaged in (1, 16, 128):
            means = np.reshape(values, (3, ticks // averaged, averaged, 4)).mean(axis=2)
            allan = np.sqrt(0.5 * np.mean(np.diff(means, axis=1) ** 2))
            count = 12 * ticks // averaged
            assert allan == pytest.approx(density / np.sqrt(averaged / RATE), rel=5.0 / np.sqrt(count))


def test_biases_walk_by_their_density_and_the_square_root_of_time() -> None:
    steps, step, vehicles = 400, 0.01, 500
    zero = ImuSample(*((np.zeros(vehicles),) * 3 for _ in range(2)))
    parameters = BiasParameters(zero, WALK * np.sqrt(step), 3.0 * WALK * np.sqrt(step))
    noise, bias = noise_of(steps, vehicles, "imu_bias"), zero
    for k in range(steps):
        bias = imu.walk(parameters, bias, ImuSample(*(tuple(x[k] for x in part) for part in noise)))
    for values, density in ((bias.omega, WALK), (bias.specific_force, 3.0 * WALK)):
        assert np.std(values) == pytest.approx(density * np.sqrt(steps * step), rel=0.08)


def test_samples_end_at_the_range_and_are_untouched_within() -> None:
    parameters = ImuParameters(0.0, 0.0, 5.0, 30.0)
    felt = ImuSample((4.9, -7.0, 5.1), (-31.0, 29.0, np.inf))
    nothing = ImuSample((0.0,) * 3, (0.0,) * 3)
    sample = measured(parameters, felt, nothing)
    assert sample.omega == (4.9, -5.0, 5.0)
    assert sample.specific_force == (-30.0, 29.0, 30.0)


def test_a_gyro_of_too_small_a_range_saturates_in_a_flip_and_one_of_2000_deg_does_not() -> None:
    wide, narrow = (flip(with_imu(gyro_range=np.radians(limit)))[0] for limit in (2000.0, 250.0))
    assert np.abs(wide).max() > np.radians(250.0)
    np.testing.assert_array_equal(narrow, np.clip(wide, -np.radians(250.0), np.radians(250.0)))


def test_the_bias_of_the_draw_is_in_every_sample() -> None:
    dispersion = with_imu(gyro_bias=0.02, accelerometer_bias=0.1)
    columns = drawn(dispersion, QUAD, 1).columns
    biased, exact = flip(dispersion), flip(with_imu())
    np.testing.assert_allclose(
        biased[0] - exact[0], np.broadcast_to(columns["gyro_bias"][0], exact[0].shape), atol=1e-12
    )
    np.testing.assert_allclose(
        biased[1] - exact[1], np.broadcast_to(columns["accelerometer_bias"][0], exact[1].shape), atol=1e-12
    )
