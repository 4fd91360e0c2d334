"""A real Betaflight board, flown live: goals and states in, a receiver's channels out over a serial line."""

from __future__ import annotations

import numpy as np

from aerobat.control import Seen
from aerobat.control.laws.rates import Rates, RatesState
from aerobat.control.parameters import controller_parameters
from aerobat.engines.floats import FloatOps, first_numbers
from aerobat.environment import Environment
from aerobat.errors import SpecError, import_extra
from aerobat.kernels.control import ControllerModel
from aerobat.kernels.control_loops import ReferencePoint
from aerobat.kernels.quaternions import axes, to_body
from aerobat.kernels.rigid_body import Body
from aerobat.kernels.vectors import add_scaled, scale, subtract
from aerobat.links.autopilot.references import PathReference
from aerobat.links.betaflight.crsf import CRSF
from aerobat.links.betaflight.msp import MSP
from aerobat.links.betaflight.packets import ReceiverProtocol, Sticks
from aerobat.links.betaflight.settings import board_rate, rotor_order, throttle_of
from aerobat.links.goals import TAKEOFF_THRESHOLD, Observed, PathPiece
from aerobat.so3 import exp, multiply
from aerobat.vehicle import Vehicle
from aerobat.vehicle.fleet import Fleet

PROTOCOLS = {"msp": MSP, "crsf": CRSF}
_LANDED_HEIGHT = 0.05  # [m] height above the ground within which a goal below the ground ends the flight
_AIRBORNE_HEIGHT = 0.3  # [m] height above the ground from which motors are not stopped: the failsafe decides
_PAUSE = 0.1  # [s] without goals, after which the outer loop is reset


class SerialLine:
    """A serial line, or a TCP connection in its place, to which frames are written."""

    def __init__(self, address: str, baud: int) -> None:
        """Open the line.

        Args:
            address: A serial device, or socket://HOST:PORT.
            baud: Of a serial device [bit/s].

        Raises SpecError where it cannot be opened, BackendMissing without pyserial.
        """
        serial = import_extra("serial", "boards need pyserial", "aerobat[board]")
        self._address, self._broken = address, (OSError, serial.SerialException)
        try:
            self._line = serial.serial_for_url(address, baud, timeout=0, write_timeout=0.1)
        except (*self._broken, ValueError) as error:
            raise SpecError(
                f"cannot open {address}: {error}; give a serial device that is there, or socket://HOST:PORT"
            ) from None

    def send(self, frame: bytes) -> None:
        """Write a frame, and discard received bytes. Raises SpecError where the line is cut."""
        try:
            self._line.write(frame)
            self._line.read(4096)
        except self._broken as error:
            raise SpecError(f"the line to the board, {self._address}, is cut: {error}") from None

    def close(self) -> None:
        """Close the line."""
        self._line.close()


class Board:
    """A Betaflight board that is flown by body rates and thrust along goals; see `take`.

    A goal above the ground arms the board, and a goal below the ground disarms it. If goals stop in the air,
    the board receives no more channels, and its failsafe takes over.
    """

    def __init__(
        self,
        line: SerialLine,
        protocol: ReceiverProtocol,
        vehicle: Vehicle,
        environment: Environment,
        period: float,
    ) -> None:
        """Prepare.

        Args:
            line: To the board.
            protocol: Of its receiver setting.
            vehicle: The nominal vehicle, for which the board is configured.
            environment: Of the flight.
            period: From one goal to the next [s].
        """
        rotor_order(vehicle)
        self._line, self._vehicle, self._period = line, vehicle, period
        self._gravity = environment.gravity
        self._sticks = Sticks(board_rate(vehicle), protocol)
        model = controller_parameters(vehicle.controller, Fleet.of([vehicle]), environment)
        self._model: ControllerModel = first_numbers(model)
        self._law = Rates()
        self._state: RatesState | None = None
        self._last = 0.0  # [s] time of the law's last step
        self._ground: float | None = None  # [m] height where the board was armed

    def take(self, piece: PathPiece | None, observed: Observed | None, now: float) -> None:
        """Send the channels of a tick.

        Args:
            piece: Of the path from now on; None where there is no goal.
            observed: The last state, None before the first.
            now: The time [s].

        Raises SpecError where the line is cut.
        """
        height = 0.0 if observed is None or self._ground is None else observed.body.position[2] - self._ground
        if piece is None or observed is None:
            if height < _AIRBORNE_HEIGHT:
                self._stop()
            return
        if self._ground is None:
            self._ground = observed.body.position[2]
        above = float(piece.end.position[2]) - self._ground
        if above < 0.0 and height < _LANDED_HEIGHT:
            self._stop()
        elif self._state is None and above < TAKEOFF_THRESHOLD:
            self._line.send(self._sticks.idle(armed=True))
        else:
            self._line.send(self._flown(piece, observed, now))

    def close(self) -> None:
        """Close the line."""
        self._line.close()

    def _stop(self) -> None:
        self._state = self._ground = None
        self._line.send(self._sticks.idle(armed=False))

    def _flown(self, piece: PathPiece, observed: Observed, now: float) -> bytes:
        """Return the frame of rates and thrust along a piece, averaged until the next tick."""
        middle = now + 0.5 * self._period
        points = PathReference(piece).reference(np.array([middle]), self._period, self._gravity)
        reference: ReferencePoint = first_numbers(points)
        law_input = Seen(_extrapolated(observed, reference, middle, self._gravity), (), reference)
        if self._state is None or now - self._last > _PAUSE:
            self._state = self._law.init(FloatOps, self._model, law_input)
        else:
            self._state, _ = self._law.step(FloatOps, self._model, self._state, law_input, now - self._last)
        assert self._state is not None, "it was made just now"
        self._last = now
        setpoint = self._state.setpoint
        return self._sticks.packet(setpoint.omega, throttle_of(self._vehicle, setpoint.thrust))


def board_at(address: str, vehicle: Vehicle, environment: Environment, period: float) -> Board | None:
    """Return the board of an address, None for an address of something else.

    Args:
        address: msp: or crsf:, and a serial device or socket://HOST:PORT.
        vehicle: The nominal vehicle, see `Board`.
        environment: Of the flight.
        period: From one goal to the next [s].

    Raises SpecError for a line that cannot be opened or a vehicle that no board flies, BackendMissing without
    pyserial.
    """
    name, _, place = address.partition(":")
    protocol = PROTOCOLS.get(name)
    if protocol is None:
        return None
    return Board(SerialLine(place, protocol.baud), protocol, vehicle, environment, period)


def _extrapolated(observed: Observed, reference: ReferencePoint, time: float, gravity: float) -> Body:
    """Return the body at a time [s], extrapolated from its observation by the reference's accelerations."""
    age, body = time - observed.time, observed.body
    acceleration = subtract(reference.specific_thrust, (0.0, 0.0, gravity))
    turning = to_body(axes(body.q_world_body), reference.omega_dot)
    mean = add_scaled(body.omega_body, 0.5 * age, turning)
    w, x, y, z = multiply(np.array(body.q_world_body), exp(np.array(scale(age, mean)))).tolist()
    return Body(
        add_scaled(add_scaled(body.position, age, body.velocity), 0.5 * age**2, acceleration),
        add_scaled(body.velocity, age, acceleration),
        (w, x, y, z),
        add_scaled(body.omega_body, age, turning),
    )
