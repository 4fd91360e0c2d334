"""The settings of the tracking controller, and the gains that follow from them for a vehicle."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from aerobat.errors import SpecError
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
    lead_filter: float = 0.01  # [s] time constant that the lead leaves in place of the rotors' lag
    moment_feedforward: bool = True  # the moment that the reference asks, J ω' + ω × Jω
    motor_lag_lead: bool = True  # commands that lead the rotors' lag
    yaw_shed_first: bool = True  # on saturation, give up the yaw moment before roll and pitch

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.type == "bool":
                _require_switch(field.name, value)
            else:
                _require_gain(field.name, value)

    def effect_delay(self, period: float) -> float:
        """How long commands given every `period` [s] take, on the average, to become thrust [s].

        The lead leaves a first-order filter in place of the rotors' lag; sampled, it delays a ramp so long.
        """
        if not self.motor_lag_lead:
            return 0.0
        return period / -math.expm1(-period / max(self.lead_filter, _SMALLEST))

    def gains(self, agility: Scalar, ops: Any = np) -> Gains:
        """The gains for a vehicle that the attitude loop's frequency must not exceed `agility` [rad/s].

        `ops` are of the arithmetic of the controller's own numbers: dual ones have dual gains.
        """
        frequency = ops.minimum(self.attitude_frequency, agility)
        slower = frequency / max(self.attitude_frequency, _SMALLEST)
        like = np.ones_like(agility)
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
            lead_filter=max(self.lead_filter, _SMALLEST) * like,
        )


class Gains(NamedTuple):
    """The numbers that the loops read, scalars or one for each vehicle; see `Controller`."""

    position: Scalar
    velocity: Scalar
    integral: Scalar
    max_integral: Scalar
    max_feedback: Scalar
    jerk_filter: Scalar
    stiffness: Scalar  # [1/s²] of the attitude loop, on the vector part of a quaternion: 2 ω_n²
    damping: Scalar  # [1/s] of the attitude loop, 2 ζ ω_n
    attitude_integral: Scalar
    max_attitude_integral: Scalar
    lead_filter: Scalar


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
