"""Settings of the filter: sensor noise, initial uncertainty and outlier rejection."""

from __future__ import annotations

from math import radians

import numpy as np

from aerobat.declaration import Count, Fraction, NonNegative, Positive, declared, validated
from aerobat.environment import Imu, MotionCapture
from aerobat.kernels.ekf import EkfParameters

_MIN_POSITION_NOISE = 1e-4  # [m] safely above the filter's own rounding and first-order errors
_MIN_ATTITUDE_NOISE = 1e-3  # [rad] likewise


@declared
class Ekf:
    """Settings of the error-state Kalman filter: sensor noise as in data sheets, and outlier rejection."""

    gyro_noise: NonNegative = 1e-3  # [rad/s/√Hz] density of the white noise
    accelerometer_noise: NonNegative = 0.02  # [m/s²/√Hz] density of the white noise
    gyro_bias: NonNegative = 0.02  # [rad/s] 1σ at the start, each axis
    accelerometer_bias: NonNegative = 0.1  # [m/s²] 1σ at the start, each axis
    gyro_bias_walk: NonNegative = 1.9e-5  # [rad/s²/√Hz] the bias spreads by this times √t
    accelerometer_bias_walk: NonNegative = 3e-3  # [m/s³/√Hz] the bias spreads by this times √t
    position_noise: Positive = 0.001  # [m] 1σ of a pose, each axis
    attitude_noise: Positive = radians(0.3)  # [rad] 1σ of a pose, about each body axis
    start_velocity: NonNegative = 0.05  # [m/s] 1σ of the assumed initial velocity, each axis
    gate_probability: Fraction = 0.9999  # probability that a correct pose is accepted
    rejections_until_jump: Count = 5  # poses rejected in a row, the last of which is accepted as a jump

    @classmethod
    @validated
    def of_sensors(cls, imu: Imu, motion_capture: MotionCapture, start_velocity: NonNegative = 0.05) -> Ekf:
        """Return a filter with the noise of its sensors; noise-free poses get a small noise.

        Args:
            imu: the vehicle's IMU.
            motion_capture: the source of its poses.
            start_velocity: 1σ of the initial velocity [m/s], each axis.
        """
        return cls(
            gyro_noise=imu.gyro_noise,
            accelerometer_noise=imu.accelerometer_noise,
            gyro_bias=imu.gyro_bias,
            accelerometer_bias=imu.accelerometer_bias,
            gyro_bias_walk=imu.gyro_bias_walk,
            accelerometer_bias_walk=imu.accelerometer_bias_walk,
            position_noise=max(motion_capture.position_noise, _MIN_POSITION_NOISE),
            attitude_noise=max(motion_capture.attitude_noise, _MIN_ATTITUDE_NOISE),
            start_velocity=start_velocity,
        )

    @property
    def max_nis(self) -> float:
        """The largest accepted normalized innovation squared: the quantile of χ² at `gate_probability`."""
        from scipy.special import chdtri  # a slow import, which the settings alone do not need

        return float(chdtri(6, 1.0 - self.gate_probability))  # a pose has 6 degrees of freedom


def ekf_parameters(settings: Ekf, gravity: float, vehicles: int) -> EkfParameters:
    """Return the numbers that the kernel reads, leaves (vehicles,); gravity in m/s²."""
    numbers = EkfParameters(
        gravity=gravity,
        gyro_noise=settings.gyro_noise**2,
        accelerometer_noise=settings.accelerometer_noise**2,
        gyro_walk=settings.gyro_bias_walk**2,
        accelerometer_walk=settings.accelerometer_bias_walk**2,
        velocity_variance=settings.start_velocity**2,
        gyro_bias_variance=settings.gyro_bias**2,
        accelerometer_bias_variance=settings.accelerometer_bias**2,
        position_variance=settings.position_noise**2,
        attitude_variance=settings.attitude_noise**2,
        max_nis=settings.max_nis,
        max_rejections=float(settings.rejections_until_jump),
    )
    return EkfParameters(*(np.full(vehicles, number) for number in numbers))
