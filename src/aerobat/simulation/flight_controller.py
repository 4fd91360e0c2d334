"""The interface to a flight controller's own firmware, which replaces the model of the inner loop."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple, Protocol

from aerobat.kernels.ops import PerRotor, Quaternion, Vector
from aerobat.kernels.rate_loop import RateSetpoint
from aerobat.registry import Registry
from aerobat.vehicle import Vehicle


class Sensed(NamedTuple):
    """Measurements of a flight controller at an instant."""

    omega: Vector  # [rad/s] body
    specific_force: Vector  # [m/s²] body
    q_world_body: Quaternion


class AutopilotRun(Protocol):
    """A firmware in operation, which flies a vehicle."""

    def step(self, sensed: Sensed, setpoint: RateSetpoint, duration: float) -> PerRotor:
        """Return the rotor commands [N] for the next `duration` [s]. Raises SpecError where it gives up."""

    def close(self) -> None:
        """End the firmware; called once, whatever became of the flight."""


class Autopilot(ABC):
    """A flight controller's firmware behind our outer loop, which commands body rates and thrust.

    A custom autopilot inherits from this class and is registered by `AUTOPILOTS.add("its-name", cls)`.
    """

    kind: ClassVar[str] = ""  # its name in settings, set when it is registered

    @abstractmethod
    def begin(self, vehicle: Vehicle, setpoint: RateSetpoint, max_rate: float) -> AutopilotRun:
        """Return the firmware, armed, with its motors at the first set-point.

        Args:
            vehicle: The nominal vehicle that the firmware is configured for.
            setpoint: The set-point at the start.
            max_rate: The largest rate [rad/s] of the reference about any axis.

        Raises BackendMissing where the firmware is not installed, SpecError for a vehicle that it cannot fly.
        """

    @abstractmethod
    def require(self) -> None:
        """Raise BackendMissing where the firmware, or a program that it needs, is not installed."""

    def logging_to(self, file: str) -> Autopilot:
        """Return a copy that writes its own log of a flight to a file; unchanged if it keeps no log."""
        return self

    def settings(self, vehicle: Vehicle, max_rate: float) -> str:
        """Return the firmware's settings for a real board, as text for its command line; none by default.

        Args:
            vehicle: The vehicle that the firmware is configured for.
            max_rate: The largest rate [rad/s] of the reference about any axis.
        """
        return ""


AUTOPILOTS: Registry[Autopilot] = Registry(
    Autopilot,  # type: ignore[type-abstract]
    "autopilot",
    "aerobat.autopilots",
    {"betaflight": "aerobat.links.betaflight.autopilot"},
)
