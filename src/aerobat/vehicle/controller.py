"""The settings of the tracking controller, and the gains that follow from them for a vehicle."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from aerobat.declaration import NonNegative, declared
from aerobat.kernels.control_loops import FeatureFlags, Gains
from aerobat.kernels.ops import Scalar

_SMALLEST = 1e-9  # [s], [rad/s] replaces zero in divisions


@declared
class Controller:
    """Gains, filters and switches of the tracking controller (paper, Section III).

    Gains are per unit of mass and of inertia, so that one set suits all vehicles. If a vehicle's rotors are
    too weak or too slow for the attitude loop, both loops are slowed down by one factor (`gains`). The three
    switches add features that reduce the tracking error; with all off, the law is the paper's (`paper`).

    The disturbance observer estimates forces and moments that the model does not contain: drag, gusts, rotors
    with more or less thrust than nominal. Its speed is limited by its filter and the rotors' lag. It needs an
    IMU in the conditions of a flight. Without an IMU, or with rotor lags above 50 ms, only the integrals of
    the errors compensate disturbances. Disturbing moments are compensated with `moment_feedforward` only.
    """

    position_gain: NonNegative = 25.0  # [1/s²]
    velocity_gain: NonNegative = 9.0  # [1/s]
    integral_gain: NonNegative = 10.0  # [1/s³]
    max_integral: NonNegative = 0.5  # [m·s] longest integral of the position error
    max_feedback: NonNegative = 15.0  # [m/s²] largest feedback acceleration
    jerk_filter: NonNegative = 0.1  # [s] time constant of the filter on the feedback's derivative
    attitude_frequency: NonNegative = 25.0  # [rad/s] ω_n of the attitude loop
    attitude_damping: NonNegative = 1.1  # [-] ζ of the attitude loop
    attitude_integral_gain: NonNegative = 1000.0  # [1/s³]
    max_attitude_integral: NonNegative = 0.05  # [rad·s]
    lead_time_constant: NonNegative = 0.005  # [s] time constant that the lead leaves of the rotors' lag
    disturbance_filter: NonNegative = 0.02  # [s] time constant of the disturbance observer; 0 for none
    moment_feedforward: bool = True  # the moment that the reference asks, J ω' + ω × Jω
    motor_lag_compensation: bool = True  # commands that lead the rotors' lag
    prioritize_tilt: bool = True  # on saturation, give up the yaw moment before roll and pitch

    @classmethod
    def paper(cls) -> Controller:
        """Return the paper's own law with the same gains, body-frame rates, and no added features."""
        return cls(
            disturbance_filter=0.0,
            moment_feedforward=False,
            motor_lag_compensation=False,
            prioritize_tilt=False,
        )

    @property
    def feature_flags(self) -> FeatureFlags:
        """The switches, which select the control law; its gains are numbers."""
        return FeatureFlags(self.moment_feedforward, self.motor_lag_compensation, self.prioritize_tilt)

    def gains(self, max_bandwidth: Scalar, ops: Any = np, **instead: Scalar) -> Gains:
        """Return the gains for a vehicle whose attitude bandwidth must not exceed `max_bandwidth` [rad/s].

        `instead` replaces settings by numbers of the arithmetic `ops`, such as dual numbers, which then give
        dual gains.
        """
        setting = SimpleNamespace(**(vars(self) | instead))
        frequency = ops.minimum(setting.attitude_frequency, max_bandwidth)
        slower = frequency / max(setting.attitude_frequency, _SMALLEST)
        like = np.ones_like(max_bandwidth)
        return Gains(
            position=setting.position_gain * slower**2,
            velocity=setting.velocity_gain * slower,
            integral=setting.integral_gain * slower**3,
            max_integral=setting.max_integral * like,
            max_feedback=setting.max_feedback * like,
            jerk_filter=setting.jerk_filter * like,
            stiffness=2.0 * frequency**2,
            damping=2.0 * setting.attitude_damping * frequency,
            attitude_integral=setting.attitude_integral_gain * slower**3,
            max_attitude_integral=setting.max_attitude_integral * like,
            lead_time_constant=max(setting.lead_time_constant, _SMALLEST) * like,
        )
