"""The interface to a flight controller's own firmware, in place of the model of its inner loop."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple, Protocol

from aerobat.declaration import Registry
from aerobat.kernels.ops import PerRotor, Quaternion, Vector
from aerobat.kernels.rate_loop import RateSetpoint
from aerobat.vehicle import Vehicle


class Sensed(NamedTuple):
    """Measurements of a flight controller at an instant."""

    omega: Vector  # [rad/s] body
    specific_force: Vector  # [m/s²] body
    q_world_body: Quaternion


class AutopilotRun(Protocol):
    """A firmware that flies a vehicle."""

    def step(self, sensed: Sensed, setpoint: RateSetpoint, duration: float) -> PerRotor:
        """Return the rotor commands [N] for the next while [s]. Raises SpecError where it gives up."""

    def close(self) -> None:
        """End the firmware; called once, whatever became of the flight."""


class Autopilot(ABC):
    """A flight controller's firmware behind our outer loop, which gives it rates and thrust.

    One of one's own inherits from this class and is registered by `AUTOPILOTS.add("its-name", cls)`.
    """

    kind: ClassVar[str] = ""  # its name in settings, set when it is registered

    @abstractmethod
    def begin(self, vehicle: Vehicle, setpoint: RateSetpoint, max_rate: float) -> AutopilotRun:
        """Return the firmware, armed, its motors at the first set-point.

        Args:
            vehicle: The nominal vehicle that the firmware is configured for.
            setpoint: At the start.
            max_rate: The most [rad/s] that the reference turns about any axis.

        Raises BackendMissing where it is not installed, SpecError for what it cannot fly or refuses.
        """

    @abstractmethod
    def require(self) -> None:
        """Raise BackendMissing where the firmware, or what it takes to run it, is not installed."""

    def logging_to(self, file: str) -> Autopilot:
        """Return the same, which writes its own log of a flight to a file; itself where it keeps none."""
        return self

    def settings(self, vehicle: Vehicle, max_rate: float) -> str:
        """Return the firmware's settings for a real board, as text for its command line; none by default.

        Args:
            vehicle: The vehicle that the firmware is configured for.
            max_rate: The most [rad/s] that the reference turns about any axis.
        """
        return ""


AUTOPILOTS: Registry[Autopilot] = Registry(
    Autopilot,  # type: ignore[type-abstract]
    "autopilot",
    "aerobat.autopilots",
    {"betaflight": "aerobat.links.betaflight.autopilot"},
)
