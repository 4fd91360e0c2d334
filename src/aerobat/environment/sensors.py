"""Sensors with the numbers of data sheets: an inertial measurement unit, and motion capture."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, pi
from typing import Annotated, Any, ClassVar

from pydantic import Field

from aerobat.declaration import (
    FieldError,
    Limit,
    NonNegative,
    Positive,
    UnitVector,
    Vector3,
    declared,
    number,
)
from aerobat.states import STANDARD_GRAVITY

SensorRate = Annotated[float, Field(ge=1, le=1e6, description="number from 1 to 1e6")]
Probability = Annotated[float, Field(ge=0, le=1, description="number from 0 to 1")]
AngleSpread = Annotated[float, Field(ge=0, le=pi, description="number of radians, from 0 to π")]


@declared
class Imu:
    """An inertial measurement unit: means of angular rate and specific force over its sample intervals.

    White noise is given by its density. Biases are drawn before each flight and then follow a random walk.
    The default is an IMU without errors.
    """

    rate: SensorRate = 1000.0  # [1/s] of its samples
    gyro_noise: NonNegative = 0.0  # [rad/s/√Hz] density of the white noise
    accelerometer_noise: NonNegative = 0.0  # [m/s²/√Hz] density of the white noise
    gyro_bias: NonNegative = 0.0  # [rad/s] 1σ at the start, each axis
    accelerometer_bias: NonNegative = 0.0  # [m/s²] 1σ at the start, each axis
    gyro_bias_walk: NonNegative = 0.0  # [rad/s²/√Hz] the bias spreads by this times √t
    accelerometer_bias_walk: NonNegative = 0.0  # [m/s³/√Hz] the bias spreads by this times √t
    gyro_range: Limit = inf  # [rad/s] largest magnitude that it shows, each axis
    accelerometer_range: Limit = inf  # [m/s²] largest magnitude that it shows, each axis

    SHORTHANDS: ClassVar[Mapping[str, str]] = {
        "gyro_range_deg": "[deg/s] `gyro_range` in degrees",
        "accelerometer_range_g": "[g] `accelerometer_range` in 9.81 m/s²",
    }

    @classmethod
    def expand(cls, table: dict[str, Any]) -> dict[str, Any]:
        """Replace the range in g."""
        shorthand = "accelerometer_range_g"
        if shorthand not in table:
            return table
        if "accelerometer_range" in table:
            raise FieldError(shorthand, "stands beside accelerometer_range; give one of them")
        return table | {"accelerometer_range": STANDARD_GRAVITY * number(table.pop(shorthand), shorthand)}


@declared
class HandOff:
    """The plane where one camera system takes over from another, and what remains of their misfit.

    Beyond the plane poses come from the second system, whose axes are offset and turned relative to those of
    the first: a pose jumps as the vehicle crosses. The cameras of both systems distort near the plane, at the
    edge of their volumes: this warp grows smoothly towards the plane. The directions of the offset, the turn
    and the warp are drawn for each flight.
    """

    point: Vector3 | None = None  # [m] of the plane; left out, the first gate's centre, else half-way to goal
    normal: UnitVector | None = None  # to the second system; left out, the gate's, else from start to goal
    translation: NonNegative = 0.0  # [m] length of the offset of the second system's axes, at `point`
    rotation: AngleSpread = 0.0  # [rad] angle of the turn of the second system's axes, about `point`
    warp: NonNegative = 0.0  # [m] displacement by the warp, at the plane
    warp_depth: Positive = 0.5  # [m] from the plane to where the warp is e^(−1/2) of that, a Gaussian

    SHORTHANDS: ClassVar[Mapping[str, str]] = {"rotation_deg": "[deg] `rotation` in degrees"}


@declared
class Outage:
    """A while in which no pose is taken."""

    start: NonNegative  # [s] since the flight's start
    duration: Positive  # [s]


@declared
class MotionCapture:
    """Cameras that see markers on the vehicle: poses, late, with gaps and outliers.

    The default is motion capture without errors.
    """

    rate: SensorRate = 100.0  # [1/s] of its samples
    position_noise: NonNegative = 0.0  # [m] 1σ, each axis and sample
    attitude_noise: AngleSpread = 0.0  # [rad] 1σ about each body axis, each sample
    latency: NonNegative = 0.0  # [s] from a pose to its arrival at the vehicle
    dropout: Probability = 0.0  # [-] that a sample is not taken or does not arrive
    outlier: Probability = 0.0  # [-] that a sample is of markers mistaken for others
    outlier_size: NonNegative = 0.0  # [m] 1σ of an outlier's further error of position, each axis
    outage: Outage | None = None  # while nothing is seen
    hand_off: HandOff | None = None  # to a second camera system; left out, there is only one

    SHORTHANDS: ClassVar[Mapping[str, str]] = {"attitude_noise_deg": "[deg] `attitude_noise` in degrees"}
