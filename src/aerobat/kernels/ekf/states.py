"""Parameters, samples and state of the filter."""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels.ekf.covariance import Covariance, ErrorState, diagonal, pack
from aerobat.kernels.imu import ImuSample
from aerobat.kernels.ops import Quaternion, Scalar, Vector
from aerobat.kernels.rigid_body import Body, Pose
from aerobat.kernels.vectors import ZERO, subtract


class EkfParameters(NamedTuple):
    """Variances that the filter reckons with; see `aerobat.estimation.Ekf`."""

    gravity: Scalar  # [m/s²] along −z
    gyro_noise: Scalar  # [rad²/s] density
    accelerometer_noise: Scalar  # [m²/s³] density
    gyro_walk: Scalar  # [rad²/s³] density of its bias's rate
    accelerometer_walk: Scalar  # [m²/s⁵] density of its bias's rate
    velocity_variance: Scalar  # [m²/s²] at first, each axis
    gyro_bias_variance: Scalar  # [rad²/s²] at first
    accelerometer_bias_variance: Scalar  # [m²/s⁴] at first
    position_variance: Scalar  # [m²] of poses
    attitude_variance: Scalar  # [rad²] of poses, about each axis
    max_nis: Scalar  # [-] of a pose that is believed
    max_rejections: Scalar  # [-] in a row, the last of which is believed to be a jump and taken


class NominalState(NamedTuple):
    """State as it is estimated."""

    position: Vector  # [m] world
    velocity: Vector  # [m/s] world
    q_world_body: Quaternion
    gyro_bias: Vector  # [rad/s] body
    accelerometer_bias: Vector  # [m/s²] body


class Anchor(NamedTuple):
    """Instant up to which the covariance is predicted."""

    velocity: Vector  # [m/s] nominal then, world
    q_world_body: Quaternion
    elapsed: Scalar  # [s] since then


class EkfState(NamedTuple):
    """State of the filter."""

    nominal: NominalState
    covariance: Covariance  # of the error at the anchor
    anchor: Anchor
    since_pose: Scalar  # [s] since the last pose that was taken, from its exposure: it coasts
    rejections: Scalar  # poses rejected in a row
    jumps: Scalar  # poses taken as jumps so far
    nis: Scalar  # of the last pose, of 6 degrees of freedom
    accepted: Scalar  # 1 if the last pose was taken, else 0


def init(parameters: EkfParameters, pose: Pose, velocity: Vector = ZERO) -> EkfState:
    """The state at a first pose and its instant; biases are unknown, the velocity is guessed."""
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
    """The estimated pose, to be kept at an exposure as the `past` of `fuse`."""
    return Pose(state.nominal.position, state.nominal.q_world_body)


def estimated_body(state: EkfState, sample: ImuSample) -> Body:
    """The estimate as a controller takes it, its rates those of the latest sample less their bias."""
    nominal = state.nominal
    omega = subtract(sample.omega, nominal.gyro_bias)
    return Body(nominal.position, nominal.velocity, nominal.q_world_body, omega)
