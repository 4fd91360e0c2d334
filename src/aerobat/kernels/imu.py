"""An inertial measurement unit: noisy, biased, bounded means of angular rate and specific force.

A sample stands for the interval that it ends: the trapezoid of what is felt at both ends of it. A sample of
the instant would be off by half an interval's change, which during a flip is several times the noise.
"""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels.ops import Ops, Scalar, Vector
from aerobat.kernels.vectors import ZERO, add, add_scaled, clip_components, scale, select


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
    """The last sample, and what its interval ended with."""

    sample: ImuSample
    felt: ImuSample  # without errors, at the instant
    has_felt: Scalar  # 1, or 0 before the first sample


class BiasParameters(NamedTuple):
    """Biases that walk."""

    start: ImuSample
    gyro_walk: Scalar  # [rad/s] 1σ of a step: density times the square root of its interval
    accelerometer_walk: Scalar  # [m/s²] likewise


def init() -> ImuState:
    """The state before the first sample."""
    nothing = ImuSample(ZERO, ZERO)
    return ImuState(nothing, nothing, 0.0)


def step(
    ops: Ops, parameters: ImuParameters, state: ImuState, felt: ImuSample, bias: ImuSample, noise: ImuSample
) -> ImuState:
    """The next sample, of the interval since the last one; the first is of its instant.

    Args:
        ops: the arithmetic.
        parameters: the errors.
        state: since the last sample.
        felt: the rate and specific force at this instant.
        bias: that is added.
        noise: independent standard normals.
    """
    has_before = state.has_felt > 0.5
    return ImuState(
        ImuSample(
            _measured(
                ops,
                _middle(ops, has_before, state.felt.omega, felt.omega),
                bias.omega,
                (parameters.gyro_noise, noise.omega),
                parameters.gyro_range,
            ),
            _measured(
                ops,
                _middle(ops, has_before, state.felt.specific_force, felt.specific_force),
                bias.specific_force,
                (parameters.accelerometer_noise, noise.specific_force),
                parameters.accelerometer_range,
            ),
        ),
        felt,
        1.0,
    )


def walk(parameters: BiasParameters, bias: ImuSample, noise: ImuSample) -> ImuSample:
    """Biases a step later, by independent standard normals."""
    return ImuSample(
        add_scaled(bias.omega, parameters.gyro_walk, noise.omega),
        add_scaled(bias.specific_force, parameters.accelerometer_walk, noise.specific_force),
    )


def _middle(ops: Ops, has_before: Scalar, before: Vector, now: Vector) -> Vector:
    return scale(0.5, add(select(ops, has_before, before, now), now))


def _measured(ops: Ops, mean: Vector, bias: Vector, noise: tuple[Scalar, Vector], limit: Scalar) -> Vector:
    return clip_components(ops, add(add_scaled(mean, *noise), bias), limit)
