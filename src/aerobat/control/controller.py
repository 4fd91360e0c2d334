"""The settings of the tracking controller, and the gains that follow from them for a vehicle."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from aerobat.errors import SpecError
from aerobat.kernels.control import FeatureFlags
from aerobat.kernels.control_loops import Gains
from aerobat.kernels.ops import Scalar

_SMALLEST = 1e-9  # [s], [rad/s]: stands for zero where one divides


@dataclass(frozen=True)
class Controller:
    """Gains, filters and switches of the tracking controller (paper, Section III).

    Gains are per unit of mass and of inertia, so that one set suits all vehicles; one whose rotors are too
    weak for the attitude loop gets both loops slowed down alike (`gains`). The three switches add to the
    paper's law what its tracking error depends on; with all off it is the paper's law. Raises SpecError for a
    gain that is negative or not finite.
    """

    position_gain: float = 25.0  # [1/s²]
    velocity_gain: float = 9.0  # [1/s]
    integral_gain: float = 10.0  # [1/s³]
    max_integral: float = 0.5  # [m·s] longest integral of the position error
    max_feedback: float = 15.0  # [m/s²] largest feedback acceleration
    jerk_filter: float = 0.1  # [s] time constant of the filter on the feedback acceleration's derivative
    attitude_frequency: float = 25.0  # [rad/s] ω_n of the attitude loop
    attitude_damping: float = 0.85  # [-] ζ of the attitude loop
    attitude_integral_gain: float = 1000.0  # [1/s³]
    max_attitude_integral: float = 0.05  # [rad·s]
    lead_time_constant: float = 0.01  # [s] time constant that the lead leaves in place of the rotors' lag
    moment_feedforward: bool = True  # the moment that the reference asks, J ω' + ω × Jω
    motor_lag_compensation: bool = True  # commands that lead the rotors' lag
    prioritize_tilt: bool = True  # on saturation, give up the yaw moment before roll and pitch

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.type == "bool":
                _require_switch(field.name, value)
            else:
                _require_gain(field.name, value)

    @property
    def feature_flags(self) -> FeatureFlags:
        """The switches: all that makes the control law another one, its gains being numbers."""
        return FeatureFlags(self.moment_feedforward, self.motor_lag_compensation, self.prioritize_tilt)

    def actuation_delay(self, period: float) -> float:
        """Time [s] that commands given every `period` [s] take, on the average, to become thrust.

        The lead leaves a first-order filter in place of the rotors' lag; sampled, it delays a ramp so long.
        """
        if not self.motor_lag_compensation:
            return 0.0
        return period / -math.expm1(-period / max(self.lead_time_constant, _SMALLEST))

    def gains(self, max_bandwidth: Scalar, ops: Any = np) -> Gains:
        """The gains for a vehicle whose attitude loop must not be faster than `max_bandwidth` [rad/s].

        `ops` are of the arithmetic of the controller's own numbers: dual ones have dual gains.
        """
        frequency = ops.minimum(self.attitude_frequency, max_bandwidth)
        slower = frequency / max(self.attitude_frequency, _SMALLEST)
        like = np.ones_like(max_bandwidth)
        return Gains(
            position=self.position_gain * slower**2,
            velocity=self.velocity_gain * slower,
            integral=self.integral_gain * slower**3,
            max_integral=self.max_integral * like,
            max_feedback=self.max_feedback * like,
            jerk_filter=self.jerk_filter * like,
            stiffness=2.0 * frequency**2,
            damping=2.0 * self.attitude_damping * frequency,
            attitude_integral=self.attitude_integral_gain * slower**3,
            max_attitude_integral=self.max_attitude_integral * like,
            lead_time_constant=max(self.lead_time_constant, _SMALLEST) * like,
        )


def _require_switch(name: str, value: Any) -> None:
    if not isinstance(value, bool):
        raise SpecError(f"controller.{name} must be True or False, got {value!r}")


def _require_gain(name: str, value: Any) -> None:
    try:
        sound = bool(np.all((np.asarray(value) >= 0.0) & (np.asarray(value) < np.inf)))
    except TypeError:
        sound = False
    if not sound or isinstance(value, bool):
        raise SpecError(f"controller.{name} must be a finite number, zero or more, got {value!r}")
