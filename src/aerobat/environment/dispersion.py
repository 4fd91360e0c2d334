"""Dispersions between flights: of the vehicle, its start, the wind, its battery and its sensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, ClassVar, TypeVar

from pydantic import Field

from aerobat.declaration import FieldError, Label, NonNegative, Positive, declared, validated
from aerobat.environment.sensors import AngleSpread, Imu, MotionCapture, SensorRate

T = TypeVar("T")

RelativeSpread = Annotated[float, Field(ge=0, lt=1, description="number from 0, less than 1")]


INERTIAL_ERRORS = (
    "gyro_noise",
    "accelerometer_noise",
    "gyro_bias",
    "accelerometer_bias",
    "gyro_bias_walk",
    "accelerometer_bias_walk",
)


@declared
class Gusts:
    """Wind beyond the environment's: a horizontal mean of each flight's own, and Dryden turbulence.

    The turbulence is that of MIL-F-8785C, with one intensity and one length for its three components. It is
    frozen and moves past the vehicle at `airspeed`: first-order along the mean wind, second-order across it.
    """

    mean_wind: NonNegative = 0.0  # [m/s] 1σ of the mean wind's two horizontal components
    intensity: NonNegative = 0.0  # [m/s] σ of each component of the turbulence
    length: Positive = 1.0  # [m] scale of the turbulence
    airspeed: Positive = 5.0  # [m/s] at which the frozen turbulence is swept past


@declared
class Battery:
    """A battery whose voltage falls with use, and the rotors' thrust ceilings with it.

    The discharge rate is the rotors' induced power, Σ f^1.5, relative to that in hover.
    """

    endurance: Positive  # [s] of hover, from full to empty
    sag: RelativeSpread = 0.0  # [-] by which the thrust ceilings fall from full to empty, linearly in charge
    charge_spread: RelativeSpread = 0.0  # [-] flights begin with charges drawn evenly from 1 − this to 1


@declared
class Dispersion:
    """Conditions of a flight as it would really be flown: what varies (1σ), disturbs, and is measured how.

    Factors of mass, inertia, rotors and lags are log-normal with mean 1 and the standard deviation given
    here. Controller, observer and plan know only the nominal vehicle. By default nothing varies, and
    the controller knows the true state.

    SpecError is raised for one sensor without the other: an observer needs both.
    """

    name: Label = "conditions"  # left out in a file, the file's
    mass: RelativeSpread = 0.0  # [-] 1σ, relative
    inertia: RelativeSpread = 0.0  # [-] 1σ, relative, one factor for the whole matrix
    rotor: RelativeSpread = 0.0  # [-] 1σ, relative, of each rotor's thrust for a command
    lag: RelativeSpread = 0.0  # [-] 1σ, relative, of each rotor's time constant
    drag: NonNegative = 0.0  # [1/s] unmodelled, over the nominal mass, each body axis: the size of a normal
    start_position: NonNegative = 0.0  # [m] 1σ of the true start, each axis
    start_velocity: NonNegative = 0.0  # [m/s] 1σ of the true start, each axis
    start_attitude: AngleSpread = 0.0  # [rad] 1σ of the true start, about each body axis
    control_rate: SensorRate | None = None  # [1/s] of the controller; left out, the flight's
    computation_delay: NonNegative = 0.0  # [s] from the state to the commands made of it
    imu: Imu | None = None  # of the observer, with motion_capture; without, the true state is seen
    motion_capture: MotionCapture | None = None  # of the observer, with imu
    gusts: Gusts | None = None  # left out, the environment's wind alone
    battery: Battery | None = None  # left out, always full
    description: str = ""  # where its numbers come from

    SHORTHANDS: ClassVar[Mapping[str, str]] = {"start_attitude_deg": "[deg] `start_attitude` in degrees"}
    _RELATIVE: ClassVar[tuple[str, ...]] = ("mass", "inertia", "rotor", "lag")
    _SPREADS: ClassVar[tuple[str, ...]] = (
        *_RELATIVE,
        "drag",
        "start_position",
        "start_velocity",
        "start_attitude",
    )

    def __post_init__(self) -> None:
        if (self.imu is None) != (self.motion_capture is None):
            missing, other = ("imu", "motion_capture") if self.imu is None else ("motion_capture", "imu")
            raise FieldError(missing, f"is missing; an observer takes it with {other}")

    @validated
    def scaled(self, factor: NonNegative) -> Dispersion:
        """Return the same conditions, scaled by `factor`.

        Spreads, unmodelled drag, wind, gusts, and noises, biases and misfits of sensors are multiplied.
        Rates, delays, ranges, gaps, outliers and the battery stay unchanged. SpecError is raised where a
        relative spread reaches 1.
        """
        capture = _scaled(self.motion_capture, factor, ("position_noise", "attitude_noise"))
        if capture is not None and capture.hand_off is not None:
            misfit = _scaled(capture.hand_off, factor, ("translation", "rotation", "warp"))
            capture = replace(capture, hand_off=misfit)
        return replace(
            _scaled(self, factor, self._SPREADS),
            imu=_scaled(self.imu, factor, INERTIAL_ERRORS),
            motion_capture=capture,
            gusts=_scaled(self.gusts, factor, ("mean_wind", "intensity")),
        )

    def __str__(self) -> str:
        sensors = "true state"
        if self.imu is not None and self.motion_capture is not None:
            sensors = f"IMU at {self.imu.rate:g} Hz, poses at {self.motion_capture.rate:g} Hz"
        spreads = ", ".join(f"{key} {100 * getattr(self, key):.3g} %" for key in self._RELATIVE)
        return f"{self.name}: {spreads}, {sensors}; {' '.join(self.description.split())}".removesuffix("; ")


def _scaled(value: T, factor: float, names: tuple[str, ...]) -> T:
    """Return the value with some of its numbers multiplied; None unchanged."""
    if value is None:
        return value
    return replace(value, **{name: factor * getattr(value, name) for name in names})  # type: ignore[type-var]
