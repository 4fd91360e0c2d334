"""Betaflight's own firmware as the inner loop of a simulated flight."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from aerobat.errors import SpecError
from aerobat.kernels.ops import PerRotor
from aerobat.kernels.rate_loop import RateSetpoint
from aerobat.links.betaflight.msp import arming_disable_flags
from aerobat.links.betaflight.packets import Sticks, state_packet
from aerobat.links.betaflight.process import Firmware, FirmwareEnded, configured, require_firmware
from aerobat.links.betaflight.settings import betaflight_settings, board_rate, rotor_order, throttle_of
from aerobat.simulation.flight_controller import AUTOPILOTS, Autopilot, Sensed
from aerobat.states import STANDARD_GRAVITY
from aerobat.storage import whole_file
from aerobat.vehicle import Vehicle

_STEP = 0.02  # [s] between packets while the vehicle stands
_GRACE = 5.0  # [s] after its start, in which the firmware does not arm
_AT_REST = Sensed((0.0, 0.0, 0.0), (0.0, 0.0, STANDARD_GRAVITY), (1.0, 0.0, 0.0, 0.0))
_THROTTLE = 0.05  # [-] throttle from which motors turn
_BLACKBOX = (
    "set blackbox_device = VIRTUAL",
    "set blackbox_mode = NORMAL",
    "set blackbox_sample_rate = 1/4",  # 2 kHz
    "set blackbox_high_resolution = ON",
)
_DISARM_TIME = 0.02  # [s] of motors at rest under throttle, after which the firmware counts as disarmed


class Betaflight(Autopilot):
    """Betaflight's firmware, compiled by the package betaflight for the simulator; needs gcc and Linux.

    The vehicle is held at its start until the firmware is armed and its motors turn, then released.
    """

    lines: tuple[str, ...] = ()  # of its command line, after those of the vehicle's settings
    blackbox: str | None = None  # file of the firmware's own log; None for no log

    def begin(self, vehicle: Vehicle, setpoint: RateSetpoint, max_rate: float) -> BetaflightRun:
        """Return the firmware, armed, its motors at the first set-point; see `Autopilot.begin`."""
        return BetaflightRun(vehicle, setpoint, max_rate, self.lines, self.blackbox)

    def logging_to(self, file: str) -> Betaflight:
        """See `Autopilot.logging_to`."""
        own: Any = self
        logging: Betaflight = replace(own, blackbox=file)
        return logging

    def require(self) -> None:
        """See `Autopilot.require`."""
        require_firmware()

    def settings(self, vehicle: Vehicle, max_rate: float) -> str:
        """Return the lines to paste to a board; protections of a vehicle on the ground stay on."""
        lines = betaflight_settings(vehicle, board_rate(vehicle, max_rate))
        return "\n".join(
            (f"# {vehicle.name}, for the command line of Betaflight 4.6", *lines, *self.lines, "save", "")
        )


AUTOPILOTS.add("betaflight", Betaflight)


class BetaflightRun:
    """A firmware that flies a vehicle; see `AutopilotRun`."""

    def __init__(
        self,
        vehicle: Vehicle,
        setpoint: RateSetpoint,
        peak: float,
        more: tuple[str, ...],
        blackbox: str | None,
    ) -> None:
        rate = board_rate(vehicle, peak)
        logging = () if blackbox is None else _BLACKBOX
        lines = (*betaflight_settings(vehicle, rate, simulated=True), *logging, *more)
        self._vehicle, self._blackbox = vehicle, blackbox
        self._order = rotor_order(vehicle)
        self._low = vehicle.min_thrusts[list(self._order)]
        self._span = vehicle.max_thrusts[list(self._order)] - self._low
        self._sticks = Sticks(rate)
        self._time, self._at_rest = 0.0, 0.0  # [s] of the flight, and of motors at rest under throttle
        self._firmware = Firmware(configured(lines))
        try:
            self._arm(setpoint.thrust)
        except BaseException:
            self._firmware.close()
            raise

    def _arm(self, thrust: float) -> None:
        """Arm, and run the motors at the first set-point. Raises SpecError, naming the flags set."""
        # without packets: channels received before the receiver's set-up are lost
        self._firmware.step(1.0)
        self._stand(_GRACE, self._sticks.idle(armed=False))
        self._stand(0.5, self._sticks.idle(armed=True))
        turning = Sticks(1.0).packet(_AT_REST.omega, throttle_of(self._vehicle, thrust))
        commands = self._stand(0.1, turning)
        if not any(commands):
            raise SpecError(f"autopilot: Betaflight refuses to arm: {self._flags}")

    @property
    def _flags(self) -> str:
        """The arming-disable flags that are set, in words."""
        return " and ".join(arming_disable_flags(self._firmware.exchange)) or "it names no reason"

    def _stand(self, duration: float, sticks: bytes) -> tuple[float, ...]:
        commands: tuple[float, ...] = ()
        for _ in range(round(duration / _STEP)):
            commands = self._firmware.step(_STEP, state_packet(_AT_REST), sticks)
        return commands

    def step(self, sensed: Sensed, setpoint: RateSetpoint, duration: float) -> PerRotor:
        """See `AutopilotRun.step`."""
        throttle = throttle_of(self._vehicle, setpoint.thrust)
        sticks = self._sticks.packet(setpoint.omega, throttle)
        fractions = self._firmware.step(duration, state_packet(sensed), sticks)
        self._time += duration
        self._at_rest = self._at_rest + duration if throttle > _THROTTLE and not any(fractions) else 0.0
        if self._at_rest > _DISARM_TIME:
            raise SpecError(
                f"autopilot: Betaflight disarmed {self._time:.2f} s into the flight: {self._flags}"
            )
        commands = self._low + self._span * fractions
        by_rotor = dict(zip(self._order, commands.tolist(), strict=True))
        return tuple(by_rotor[k] for k in range(len(by_rotor)))

    def close(self) -> None:
        """See `AutopilotRun.close`."""
        try:
            if self._blackbox is not None:
                self._stand(0.2, self._sticks.idle(armed=False))  # [s] until its log is complete
                with whole_file(self._blackbox) as file:
                    file.write_bytes(self._firmware.log())
        except FirmwareEnded:
            pass  # the flight has already reported this
        finally:
            self._firmware.close()
