"""The inner loop of a flight controller: from body rates and collective thrust to rotor commands.

A PID on the filtered gyro, with the derivative of the measurement only; moments have priority over thrust.
With rotors of lag τ and a moment J (p e + i ∫e − d ω'), rates follow τ ω'' + (1 + d) ω' + p ω = p ω_set. The
gains below place this pair of poles.
"""

from __future__ import annotations

from functools import reduce
from operator import add as add_scalars
from operator import mul
from typing import NamedTuple

from aerobat.kernels.allocation import Mixer, mix
from aerobat.kernels.control import Commands
from aerobat.kernels.motors import Airframe
from aerobat.kernels.ops import TINY, Ops, PerRotor, Scalar, Vector, clip, magnitude
from aerobat.kernels.rigid_body import RotorWrench
from aerobat.kernels.vectors import (
    ZERO,
    add,
    add_scaled,
    clip_components,
    low_passed,
    scale,
    subtract,
    transform,
)

# [rad/s] highest frequency of the poles in roll and pitch that the delays of the filters allow
_MAX_FREQUENCY = 75.0
# [s/rad] largest roll or pitch gain, as a fraction of the maximum moment per rate error: with more, weak
# rotors saturate; with less, slow ones respond late (lab book)
_MAX_TILT_GAIN = 0.15
_DAMPING = 0.8  # [-] damping ratio of all poles
# [s/rad] yaw gain, as a fraction of the maximum moment per rate error: with a quarter of it, rotors 3 % apart
# turned vehicles by 30° within a flip; twice as much was no better (lab book)
_MAX_YAW_GAIN = 0.04
_MAX_INTEGRAL_RATIO = 8.0  # [1/s] largest ratio of the integral gain to the proportional gain
# [-] limit of that ratio over the proportional gain, which keeps the loop damped
_MAX_INTEGRAL_FRACTION = 0.125
# [s] smallest rotor lag in the design: with faster rotors the loop's own delays dominate
_MIN_LAG = 0.01
_MAX_INTEGRAL = 0.25  # [rad] limit of the integral of the rate error, per axis


class RateSetpoint(NamedTuple):
    """Command of the outer loop: collective thrust and body rates."""

    omega: Vector  # [rad/s] body
    thrust: Scalar  # [N] collective


class RateGains(NamedTuple):
    """Gains per unit of inertia, by body axis; see the module."""

    proportional: Vector  # [1/s]
    integral: Vector  # [1/s²]
    derivative: Vector  # [-]
    frequency: Scalar  # [rad/s] of the poles in roll and pitch


class RateLoopModel(NamedTuple):
    """A nominal vehicle, and the filters of its flight controller."""

    airframe: Airframe
    mixer: Mixer
    gyro_filter: Scalar  # [s] time constant
    derivative_filter: Scalar  # [s] time constant


class RateLoopState(NamedTuple):
    """State of the inner loop from tick to tick, including its commands."""

    gyro: Vector  # [rad/s] filtered
    derivative: Vector  # [rad/s²] filtered
    integral: Vector  # [rad] of the rate error
    commands: Commands


def rate_gains(ops: Ops, airframe: Airframe) -> RateGains:
    """Return gains for the slowest rotor and the maximum moments of a vehicle.

    Roll and pitch use a derivative, so their poles can be faster than the rotors' lag alone allows. Yaw uses
    none, and less gain where its moment is weak, because roll and pitch need the rotors.
    """
    (_, inertia), rotors = airframe.mass_properties[:2], airframe.rotors
    lag = reduce(ops.maximum, (1.0 / rate for rate in rotors.inverse_time_constant), _MIN_LAG)
    roll, pitch, turn = (
        reduce(add_scalars, map(mul, (magnitude(ops, c) for c in row), rotors.max_thrust)) / inertia[k][k]
        for k, row in enumerate(rotors.allocation[1:])
    )
    tilt = ops.minimum(_MAX_FREQUENCY * _MAX_FREQUENCY * lag, _MAX_TILT_GAIN * ops.minimum(roll, pitch))
    yaw = ops.minimum(1.0 / (4.0 * _DAMPING * _DAMPING * lag), _MAX_YAW_GAIN * turn)
    frequency = ops.sqrt(tilt / lag)
    damping = ops.maximum(2.0 * _DAMPING * frequency * lag - 1.0, 0.0)
    ratios = (ops.minimum(_MAX_INTEGRAL_RATIO, _MAX_INTEGRAL_FRACTION * gain) for gain in (tilt, yaw))
    integral, yaw_integral = (gain * ratio for gain, ratio in zip((tilt, yaw), ratios, strict=True))
    return RateGains(
        (tilt, tilt, yaw), (integral, integral, yaw_integral), (damping, damping, 0.0), frequency
    )


def init(thrusts: PerRotor, gyro: Vector) -> RateLoopState:
    """Return the state before the first tick, with the present thrusts [N] as commands."""
    return RateLoopState(gyro, ZERO, ZERO, Commands(thrusts, False))


def step(
    ops: Ops,
    model: RateLoopModel,
    state: RateLoopState,
    setpoint: RateSetpoint,
    gyro: Vector,
    elapsed: Scalar,
) -> RateLoopState:
    """Return the state, including new commands, `elapsed` [s] after the last tick.

    Args:
        ops: the arithmetic of the engine.
        model: the vehicle and the filters.
        state: state after the last tick.
        setpoint: set-point of the outer loop.
        gyro: the measured rate [rad/s], body.
        elapsed: time since the last tick [s].
    """
    filtered = low_passed(state.gyro, gyro, model.gyro_filter, elapsed)
    slope = scale(1.0 / elapsed, subtract(filtered, state.gyro))
    derivative = low_passed(state.derivative, slope, model.derivative_filter, elapsed)
    error = subtract(setpoint.omega, filtered)
    integral = clip_components(ops, add_scaled(state.integral, elapsed, error), _MAX_INTEGRAL)
    gains = rate_gains(ops, model.airframe)
    angular = subtract(
        add(times(gains.proportional, error), times(gains.integral, integral)),
        times(gains.derivative, derivative),
    )
    moment = transform(model.airframe.mass_properties.inertia, angular)
    commands = _mixed(ops, model, RotorWrench(setpoint.thrust, moment))
    return RateLoopState(filtered, derivative, integral, commands)


def times(a: Vector, b: Vector) -> Vector:
    """Return the products of components."""
    return a[0] * b[0], a[1] * b[1], a[2] * b[2]


def _mixed(ops: Ops, model: RateLoopModel, load: RotorWrench) -> Commands:
    """Return commands within limits: moments scaled to fit, then collective thrust shifted to fit."""
    rotors = model.airframe.rotors
    turning = mix(model.mixer, load._replace(thrust=0.0))
    high, low = reduce(ops.minimum, rotors.max_thrust), reduce(ops.maximum, rotors.min_thrust)
    spread = reduce(ops.maximum, turning) - reduce(ops.minimum, turning)
    fraction = ops.minimum(1.0, (high - low) / (spread + TINY))
    turning = tuple(fraction * f for f in turning)
    level = load.thrust / len(turning)
    shifted = clip(ops, level, low - reduce(ops.minimum, turning), high - reduce(ops.maximum, turning))
    saturated = ops.select((fraction >= 1.0) & (shifted <= level) & (shifted >= level), False, True)
    return Commands(tuple(shifted + f for f in turning), saturated)
