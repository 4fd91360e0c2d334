"""The inner loop of a flight controller: body rates and collective thrust to rotor commands.

A PID on the filtered gyro, its derivative on the measurement alone, mixed so that moments come before thrust.
With rotors of lag τ and a moment of J (p e + i ∫e − d ω'), rates follow τ ω'' + (1 + d) ω' + p ω = p ω_set.
The gains below place that pair of poles.
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

_FREQUENCY = 75.0  # [rad/s] of the poles in roll and pitch, which the filters' delays let pass, at most
# [s/rad] of all the moment of roll or pitch, that an error of its rate asks for at most: more of it saturates
# weak rotors, and with less slow ones are late (lab book)
_TILT_SHARE = 0.15
_DAMPING = 0.8  # [-] ratio of all poles
# [s/rad] of all the moment of yaw, that an error of yaw rate asks for: with a quarter of it rotors 3 % apart
# turned vehicles by 30° within a flip, with twice as much they held it no better (lab book)
_YAW_SHARE = 0.04
_INTEGRAL = 8.0  # [1/s] integral gain over the proportional one, at most
_INTEGRAL_SHARE = 0.125  # [-] of a proportional gain, which that ratio is at most: the loop stays damped
_SHORTEST_LAG = 0.01  # [s] of rotors: faster ones leave the loop's own delays
_MAX_INTEGRAL = 0.25  # [rad] of the rate error, per axis


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
    """State of the inner loop from tick to tick, its commands among it."""

    gyro: Vector  # [rad/s] filtered
    derivative: Vector  # [rad/s²] filtered
    integral: Vector  # [rad] of the rate error
    commands: Commands


def rate_gains(ops: Ops, airframe: Airframe) -> RateGains:
    """Gains that suit the slowest rotor of a vehicle, and its moments.

    Roll and pitch have a derivative, and so poles faster than the rotors' lag alone allows. Yaw has none, and
    less gain where its moment is weak: it must leave the rotors to roll and pitch.
    """
    (_, inertia), rotors = airframe.mass_properties[:2], airframe.rotors
    lag = reduce(ops.maximum, (1.0 / rate for rate in rotors.inverse_time_constant), _SHORTEST_LAG)
    roll, pitch, turn = (
        reduce(add_scalars, map(mul, (magnitude(ops, c) for c in row), rotors.max_thrust)) / inertia[k][k]
        for k, row in enumerate(rotors.allocation[1:])
    )
    tilt = ops.minimum(_FREQUENCY * _FREQUENCY * lag, _TILT_SHARE * ops.minimum(roll, pitch))
    yaw = ops.minimum(1.0 / (4.0 * _DAMPING * _DAMPING * lag), _YAW_SHARE * turn)
    frequency = ops.sqrt(tilt / lag)
    damping = ops.maximum(2.0 * _DAMPING * frequency * lag - 1.0, 0.0)
    integral, slow = (gain * ops.minimum(_INTEGRAL, _INTEGRAL_SHARE * gain) for gain in (tilt, yaw))
    return RateGains((tilt, tilt, yaw), (integral, integral, slow), (damping, damping, 0.0), frequency)


def init(thrusts: PerRotor, gyro: Vector) -> RateLoopState:
    """The state before the first tick, with the rotors' thrusts [N] commanded as they are."""
    return RateLoopState(gyro, ZERO, ZERO, Commands(thrusts, False))


def step(
    ops: Ops,
    model: RateLoopModel,
    state: RateLoopState,
    setpoint: RateSetpoint,
    gyro: Vector,
    elapsed: Scalar,
) -> RateLoopState:
    """The state, new commands included, `elapsed` [s] after the last tick.

    Args:
        ops: of the arithmetic.
        model: the vehicle and the filters.
        state: after the last tick.
        setpoint: of the outer loop.
        gyro: the measured rate [rad/s], body.
        elapsed: since the last tick [s].
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
    """Products of components."""
    return a[0] * b[0], a[1] * b[1], a[2] * b[2]


def _mixed(ops: Ops, model: RateLoopModel, load: RotorWrench) -> Commands:
    """Commands within limits: moments are scaled to fit, then the collective thrust is moved to suit them."""
    rotors = model.airframe.rotors
    turning = mix(model.mixer, load._replace(thrust=0.0))
    high, low = reduce(ops.minimum, rotors.max_thrust), reduce(ops.maximum, rotors.min_thrust)
    spread = reduce(ops.maximum, turning) - reduce(ops.minimum, turning)
    fraction = ops.minimum(1.0, (high - low) / (spread + TINY))
    turning = tuple(fraction * f for f in turning)
    level = load.thrust / len(turning)
    moved = clip(ops, level, low - reduce(ops.minimum, turning), high - reduce(ops.maximum, turning))
    saturated = ops.select((fraction >= 1.0) & (moved <= level) & (moved >= level), False, True)
    return Commands(tuple(moved + f for f in turning), saturated)
