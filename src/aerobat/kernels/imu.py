"""An inertial measurement unit: noisy, biased and saturated means of angular rate and specific force.

A sample is the mean over the interval that it ends, computed from both ends by the trapezoidal rule. An
instantaneous sample would differ by half of the interval's change, which during a flip is several times the
noise.
"""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels.ops import Ops, Scalar, Vector, select_tree
from aerobat.kernels.vectors import ZERO, add, add_scaled, clip_components, scale


class ImuSample(NamedTuple):
    """Means over an interval, body axes."""

    omega: Vector  # [rad/s]
    specific_force: Vector  # [m/s²]


class ImuParameters(NamedTuple):
    """Errors of an IMU at its sample rate."""

    gyro_noise: Scalar  # [rad/s] 1σ of a sample: density over the square root of the interval
    accelerometer_noise: Scalar  # [m/s²] likewise
    gyro_range: Scalar  # [rad/s]
    accelerometer_range: Scalar  # [m/s²]


class ImuState(NamedTuple):
    """The last sample, and the true values at its end."""

    sample: ImuSample
    true_sample: ImuSample  # true values at the instant
    has_sample: Scalar  # 1, or 0 before the first sample


class BiasParameters(NamedTuple):
    """Random walk of the biases."""

    start: ImuSample
    gyro_walk: Scalar  # [rad/s] 1σ of a step: density times the square root of its interval
    accelerometer_walk: Scalar  # [m/s²] likewise


def init() -> ImuState:
    """Return the state before the first sample."""
    nothing = ImuSample(ZERO, ZERO)
    return ImuState(nothing, nothing, 0.0)


def step(
    ops: Ops,
    parameters: ImuParameters,
    state: ImuState,
    true_sample: ImuSample,
    bias: ImuSample,
    noise: ImuSample,
) -> ImuState:
    """Return the next sample, over the interval since the last one; the first is instantaneous.

    Args:
        ops: the arithmetic of the engine.
        parameters: the errors of the IMU.
        state: state after the last sample.
        true_sample: the true rate and specific force at this instant.
        bias: the present biases.
        noise: independent standard normals.
    """
    before = select_tree(ops, state.has_sample > 0.5, state.true_sample, true_sample)
    gyro = parameters.gyro_noise, parameters.gyro_range
    accelerometer = parameters.accelerometer_noise, parameters.accelerometer_range
    means = (scale(0.5, add(a, b)) for a, b in zip(before, true_sample, strict=True))
    measured = (
        clip_components(ops, add(add_scaled(mean, spread, drawn), offset), limit)
        for mean, (spread, limit), drawn, offset in zip(
            means, (gyro, accelerometer), noise, bias, strict=True
        )
    )
    return ImuState(ImuSample(*measured), true_sample, 1.0)


def walk(parameters: BiasParameters, bias: ImuSample, noise: ImuSample) -> ImuSample:
    """Return the biases a step later, given independent standard normals."""
    return ImuSample(
        add_scaled(bias.omega, parameters.gyro_walk, noise.omega),
        add_scaled(bias.specific_force, parameters.accelerometer_walk, noise.specific_force),
    )
