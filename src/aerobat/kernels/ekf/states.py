"""Parameters, samples and state of the filter."""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels.ekf.covariance import Covariance, ErrorState, diagonal, pack
from aerobat.kernels.imu import ImuSample
from aerobat.kernels.ops import Quaternion, Scalar, Vector
from aerobat.kernels.rigid_body import Body, Pose
from aerobat.kernels.vectors import ZERO, subtract


class EkfParameters(NamedTuple):
    """Variances of the filter; see `aerobat.estimation.Ekf`."""

    gravity: Scalar  # [m/s²] along −z
    gyro_noise: Scalar  # [rad²/s] density
    accelerometer_noise: Scalar  # [m²/s³] density
    gyro_walk: Scalar  # [rad²/s³] density of its bias's rate
    accelerometer_walk: Scalar  # [m²/s⁵] density of its bias's rate
    velocity_variance: Scalar  # [m²/s²] initial, each axis
    gyro_bias_variance: Scalar  # [rad²/s²] initial, each axis
    accelerometer_bias_variance: Scalar  # [m²/s⁴] initial, each axis
    position_variance: Scalar  # [m²] of poses, each axis
    attitude_variance: Scalar  # [rad²] of poses, about each axis
    max_nis: Scalar  # [-] largest normalized innovation squared of an accepted pose
    max_rejections: Scalar  # [-] rejections in a row, the last of which is accepted as a jump


class NominalState(NamedTuple):
    """The estimated state."""

    position: Vector  # [m] world
    velocity: Vector  # [m/s] world
    q_world_body: Quaternion
    gyro_bias: Vector  # [rad/s] body
    accelerometer_bias: Vector  # [m/s²] body


class Anchor(NamedTuple):
    """Instant to which the covariance refers."""

    velocity: Vector  # [m/s] nominal at that instant, world
    q_world_body: Quaternion
    elapsed: Scalar  # [s] since that instant


class EkfState(NamedTuple):
    """State of the filter."""

    nominal: NominalState
    covariance: Covariance  # of the error at the anchor
    anchor: Anchor
    since_pose: Scalar  # [s] since the exposure of the last accepted pose
    rejections: Scalar  # poses rejected in a row
    jumps: Scalar  # poses accepted as jumps so far
    nis: Scalar  # normalized innovation squared of the last pose, with 6 degrees of freedom
    accepted: Scalar  # 1 if the last pose was accepted, else 0


def init(parameters: EkfParameters, pose: Pose, velocity: Vector = ZERO) -> EkfState:
    """Return the state at a first pose; biases are unknown, the velocity is guessed."""
    variances = ErrorState(
        _each_axis(parameters.position_variance),
        _each_axis(parameters.velocity_variance),
        _each_axis(parameters.attitude_variance),
        _each_axis(parameters.gyro_bias_variance),
        _each_axis(parameters.accelerometer_bias_variance),
    )
    return EkfState(
        nominal=NominalState(pose.position, velocity, pose.q_world_body, ZERO, ZERO),
        covariance=pack(diagonal(variances)),
        anchor=Anchor(velocity, pose.q_world_body, 0.0),
        since_pose=0.0,
        rejections=0.0,
        jumps=0.0,
        nis=0.0,
        accepted=1.0,
    )


def _each_axis(variance: Scalar) -> Vector:
    return variance, variance, variance


def pose_of(state: EkfState) -> Pose:
    """Return the estimated pose, to be stored at an exposure as the `past` of `fuse`."""
    return Pose(state.nominal.position, state.nominal.q_world_body)


def estimated_body(state: EkfState, sample: ImuSample) -> Body:
    """Return the estimate for a controller, with the rates of the latest sample minus the gyro bias."""
    nominal = state.nominal
    omega = subtract(sample.omega, nominal.gyro_bias)
    return Body(nominal.position, nominal.velocity, nominal.q_world_body, omega)
