"""Packets between Betaflight's simulator target and a simulated vehicle, and the signs of their contents.

Betaflight counts roll to the right, pitch nose down on its stick, and yaw clockwise seen from above. Its
motors are numbered rear right, front right, rear left, front left, and sent in another order.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from typing import NamedTuple

from aerobat.kernels.ops import Vector
from aerobat.simulation.flight_controller import Sensed

_LOWEST, _CENTRE, _HIGHEST = 1000, 1500, 2000  # [µs] pulses of a stick
_TIMESTAMP = 1.0  # [s] constant: the firmware would adjust its clock speed by differences
MOTORS = ("front right", "rear left", "front left", "rear right")  # in the order of the packet


def state_packet(sensed: Sensed) -> bytes:
    """Return the packet of a state; position and velocity, which the firmware does not use, are zero."""
    p, q, r = sensed.omega
    force = (-part for part in sensed.specific_force)
    air_pressure = 101325.0  # [Pa]
    numbers = (_TIMESTAMP, p, -q, -r, *force, *sensed.q_world_body, *(0.0,) * 6, air_pressure)
    return struct.pack("<d3d3d4d3d3dd", *numbers)


class ReceiverProtocol(NamedTuple):
    """The channel format of a receiver: integer counts with a step and an offset."""

    frame: Callable[[Sequence[int]], bytes]  # of 16 counts
    offset: float = 0.0  # [µs] pulse of count 0
    step: float = 1.0  # [µs]
    baud: int = 115200  # of a serial line [bit/s]

    def count(self, pulse: float) -> int:
        """Return the count nearest to a pulse [µs]."""
        return round((pulse - self.offset) / self.step)


SIMULATOR = ReceiverProtocol(lambda counts: struct.pack("<d16H", _TIMESTAMP, *counts))


class Sticks:
    """Channels of a receiver for body rates and thrust; rounding errors are carried over to later frames."""

    def __init__(self, max_rate: float, protocol: ReceiverProtocol = SIMULATOR) -> None:
        """Prepare.

        Args:
            max_rate: [rad/s] at the end of each stick.
            protocol: The format of the channels.
        """
        self._scale = 500.0 / max_rate  # [µs/(rad/s)]
        self._protocol = protocol
        self._carried = [0.0] * 4

    def packet(self, omega: Vector, throttle: float) -> bytes:
        """Return the armed packet of body rates [rad/s] and a throttle, 0 to 1 of the thrust range."""
        p, q, r = omega
        wanted = (
            _CENTRE + self._scale * p,
            _CENTRE + self._scale * q,
            1050.0 + 950.0 * throttle,  # below 1050 µs, min_check, the motors idle
            _CENTRE - self._scale * r,
        )
        return self._framed([self._rounded(k, pulse) for k, pulse in enumerate(wanted)], armed=True)

    def idle(self, armed: bool) -> bytes:
        """Return the packet of centred sticks and no throttle."""
        return self._framed([*map(self._protocol.count, (_CENTRE, _CENTRE, _LOWEST, _CENTRE))], armed)

    def _rounded(self, channel: int, pulse: float) -> int:
        step, exact = self._protocol.step, pulse + self._carried[channel]
        sent = self._protocol.count(min(max(exact, _LOWEST), _HIGHEST))
        missing = exact - (self._protocol.offset + step * sent)
        self._carried[channel] = min(max(missing, -0.5 * step), 0.5 * step)
        return sent

    def _framed(self, sticks: Sequence[int], armed: bool) -> bytes:
        switches = [1900 if armed else 1000] + [1000] * 11  # [µs]; the first one arms
        return self._protocol.frame([*sticks, *map(self._protocol.count, switches)])
