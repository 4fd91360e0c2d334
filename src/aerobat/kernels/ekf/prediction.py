"""Prediction from IMU samples: the nominal state, and the covariance of its error."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from aerobat.kernels.ekf.covariance import ErrorState, add_diagonal, pack, transform_part, unpack
from aerobat.kernels.ekf.states import Anchor, EkfParameters, EkfState
from aerobat.kernels.imu import ImuSample
from aerobat.kernels.ops import Ops, Scalar, Vector
from aerobat.kernels.quaternions import (
    axes,
    conjugate,
    exp_of_small,
    multiply,
    normalize,
    rotate,
    to_body,
    to_world,
)
from aerobat.kernels.vectors import add, add_scaled, cross, scale, subtract

_MIN_DURATION = 1e-9  # [s] divisor in place of zero time

Change: TypeAlias = tuple[str, Callable[[ErrorState], Vector]]


def propagate(
    ops: Ops, parameters: EkfParameters, state: EkfState, sample: ImuSample, elapsed: Scalar
) -> EkfState:
    """Return the nominal state after an interval; the covariance is not yet predicted.

    The sample is a mean over the interval. Therefore the attitude turns by exp(ω T), and the specific force
    is rotated by the attitude in the middle of the interval.

    Args:
        ops: the arithmetic of the engine.
        parameters: parameters of the filter.
        state: state at the interval's start.
        sample: IMU sample of the interval.
        elapsed: duration T of the interval [s].
    """
    nominal = state.nominal
    turn = scale(elapsed, subtract(sample.omega, nominal.gyro_bias))
    half = exp_of_small(scale(0.5, turn))
    q_middle = multiply(nominal.q_world_body, half)
    force = rotate(q_middle, subtract(sample.specific_force, nominal.accelerometer_bias))
    acceleration = force[0], force[1], force[2] - parameters.gravity
    middle = add_scaled(nominal.velocity, 0.5 * elapsed, acceleration)
    propagated = nominal._replace(
        position=add_scaled(nominal.position, elapsed, middle),
        velocity=add_scaled(nominal.velocity, elapsed, acceleration),
        q_world_body=normalize(ops, multiply(q_middle, half)),
    )
    return state._replace(
        nominal=propagated,
        anchor=state.anchor._replace(elapsed=state.anchor.elapsed + elapsed),
        since_pose=state.since_pose + elapsed,
    )


def predict_covariance(ops: Ops, parameters: EkfParameters, state: EkfState) -> EkfState:
    """Return the state with its covariance predicted from the anchor to now."""
    elapsed = state.anchor.elapsed
    rows = unpack(state.covariance)
    for part, change in transition(ops, parameters, state):
        rows = transform_part(rows, part, change)
    noise = {
        "velocity": parameters.accelerometer_noise * elapsed,
        "rotation": parameters.gyro_noise * elapsed,
        "gyro_bias": parameters.gyro_walk * elapsed,
        "accelerometer_bias": parameters.accelerometer_walk * elapsed,
    }
    return anchored(state._replace(covariance=pack(add_diagonal(rows, noise))))


def anchored(state: EkfState) -> EkfState:
    """Return the state with its anchor at the present, which the covariance must already refer to."""
    return state._replace(anchor=Anchor(state.nominal.velocity, state.nominal.q_world_body, 0.0))


def transition(ops: Ops, parameters: EkfParameters, state: EkfState) -> tuple[Change, Change, Change]:
    """Return first-order maps of the error's parts from the anchor to now, to be applied in this order.

    δp ← δp + T δv, δv ← δv − T R (f × δθ + δb_a), δθ ← Γ δθ − T δb_g. R is the attitude at the anchor. T f is
    the change of velocity without gravity's, in the anchor's axes. Γ = R_nowᵀ R.
    """
    nominal, anchor, elapsed = state.nominal, state.anchor, state.anchor.elapsed
    body_axes = axes(anchor.q_world_body)
    x, y, z = subtract(nominal.velocity, anchor.velocity)
    rate = 1.0 / ops.maximum(elapsed, _MIN_DURATION)
    force = to_body(body_axes, scale(rate, (x, y, z + parameters.gravity * elapsed)))
    turn_back = axes(multiply(conjugate(nominal.q_world_body), anchor.q_world_body))
    scaled_axes = (scale(elapsed, body_axes[0]), scale(elapsed, body_axes[1]), scale(elapsed, body_axes[2]))

    def position(error: ErrorState) -> Vector:
        return add_scaled(error.position, elapsed, error.velocity)

    def velocity(error: ErrorState) -> Vector:
        force_error = add(cross(force, error.rotation), error.accelerometer_bias)
        return subtract(error.velocity, to_world(scaled_axes, force_error))

    def rotation(error: ErrorState) -> Vector:
        return add_scaled(to_world(turn_back, error.rotation), -elapsed, error.gyro_bias)

    return ("position", position), ("velocity", velocity), ("rotation", rotation)
