"""Settings of the filter: what it reckons with."""

from __future__ import annotations

from math import radians

import numpy as np

from aerobat.declaration import Count, Fraction, NonNegative, Positive, declared
from aerobat.environment import Environment
from aerobat.kernels.ekf import EkfParameters

POSE_FREEDOMS = 6


@declared
class Ekf:
    """Noise, biases and trust of the error-state Kalman filter; 1σ, densities as data sheets have them."""

    gyro_noise: NonNegative = 1e-3  # [rad/s/√Hz] density of the white noise
    accelerometer_noise: NonNegative = 0.02  # [m/s²/√Hz] density of the white noise
    gyro_bias: NonNegative = 0.02  # [rad/s] 1σ at the start, each axis
    accelerometer_bias: NonNegative = 0.1  # [m/s²] 1σ at the start, each axis
    gyro_bias_walk: NonNegative = 1e-4  # [rad/s²/√Hz] the bias spreads by this times √t
    accelerometer_bias_walk: NonNegative = 1e-3  # [m/s³/√Hz] the bias spreads by this times √t
    position_noise: Positive = 0.001  # [m] 1σ of a pose, each axis
    attitude_noise: Positive = radians(0.3)  # [rad] 1σ of a pose, about each body axis
    start_velocity: NonNegative = 0.05  # [m/s] 1σ of what is taken for the velocity at first, each axis
    gate_probability: Fraction = 0.9999  # of a true pose to be believed
    rejections_until_jump: Count = 5  # poses rejected in a row, the last of which is believed to be a jump

    def parameters(self, environment: Environment, vehicles: int) -> EkfParameters:
        """The numbers that the kernel reads, leaves (vehicles,)."""
        from scipy.special import chdtri

        numbers = EkfParameters(
            gravity=environment.gravity,
            gyro_noise=self.gyro_noise**2,
            accelerometer_noise=self.accelerometer_noise**2,
            gyro_walk=self.gyro_bias_walk**2,
            accelerometer_walk=self.accelerometer_bias_walk**2,
            velocity_variance=self.start_velocity**2,
            gyro_bias_variance=self.gyro_bias**2,
            accelerometer_bias_variance=self.accelerometer_bias**2,
            position_variance=self.position_noise**2,
            attitude_variance=self.attitude_noise**2,
            max_nis=float(chdtri(POSE_FREEDOMS, 1.0 - self.gate_probability)),
            max_rejections=float(self.rejections_until_jump),
        )
        return EkfParameters(*(np.full(vehicles, number) for number in numbers))
