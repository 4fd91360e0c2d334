"""Connections for MAVLink messages by pymavlink, and one that loses and delays some of them."""

from __future__ import annotations

import os
import socket
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import cache, partial
from typing import Any, Protocol, TypeAlias

import numpy as np

from aerobat.errors import SpecError, import_extra
from aerobat.links.clock import Clock

_KINDS = ("udp", "udpin", "udpout", "tcp", "tcpin")
_REOPEN_TIMEOUT = 1.0  # [s] of wall time, limit for reopening a broken link, and pause between attempts

MavlinkMessage: TypeAlias = Any  # of pymavlink's classes


class Connection(Protocol):
    """A connection for messages."""

    def receive(self) -> list[MavlinkMessage]:
        """Return the messages received since the last call; never waits."""

    def send(self, message: MavlinkMessage) -> None:
        """Send a message of the dialect `common`."""

    def close(self) -> None:
        """Close the socket or the device."""


@cache
def dialect() -> Any:
    """Return pymavlink's dialect `common`. Raises BackendMissing where pymavlink is not installed."""
    os.environ["MAVLINK20"] = "1"  # read by pymavlink when it is imported
    return import_extra("pymavlink.dialects.v20.common", "MAVLink needs pymavlink", "aerobat[mavlink]")


def message_class(name: str) -> Any:
    """Return the dialect's message class of a name in small letters, as "param_value"."""
    return getattr(dialect(), f"MAVLink_{name}_message")


def connect(address: str, *, listen: bool, system: int, component: int = 1, baud: int = 57600) -> Connection:
    """Open a connection.

    Raises SpecError, one sentence, for an invalid or unavailable address, BackendMissing without
    pymavlink.

    Args:
        address: udp:HOST:PORT, udpin:, udpout:, tcp: or tcpin: likewise, or a serial device.
        listen: for udp: and tcp:, wait on that port rather than send there first.
        system: our number among MAVLink's systems.
        component: our number among the system's components.
        baud: the rate of a serial device [bit/s].
    """
    dialect()
    place = _host_and_port(address)
    if listen and address.startswith("tcp:"):
        address = address.replace("tcp:", "tcpin:", 1)
    from pymavlink import mavutil

    # pymavlink prints link errors on standard output, which is for the report
    mavutil.print = lambda *words: None
    open_link = partial(
        mavutil.mavlink_connection,
        address,
        baud=baud,
        source_system=system,
        source_component=component,
        input=listen,
        dialect="common",
        retries=0,
    )
    try:
        if place is not None:
            socket.getaddrinfo(*place)  # UDP would accept an unknown host name in silence
        return _PymavlinkConnection(open_link)
    except Exception as error:  # sockets, devices and resolvers raise various exceptions
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise SpecError(f"cannot open {address}: {reason}; give another address or port") from None


def _host_and_port(address: str) -> tuple[str, str] | None:
    """Return the host and port of an address; None for a device. Raises SpecError for anything else."""
    kind, _, rest = address.partition(":")
    if kind in _KINDS:
        host, _, port = rest.rpartition(":")
        if not host or not port.isdecimal() or not 0 < int(port) < 65536:
            raise SpecError(f"{address} is no address; give {kind}:HOST:PORT, as in {kind}:127.0.0.1:14540")
        return host, port
    if not os.path.exists(address):
        raise SpecError(
            f"{address} is neither a device nor an address; give udp:HOST:PORT, tcp:HOST:PORT or a serial "
            "device that is there"
        )
    return None


class _PymavlinkConnection:
    """A pymavlink link; a broken link is silent, and is reopened from time to time."""

    def __init__(self, open_link: Callable[[], Any]) -> None:
        self._open_link = open_link
        self._broke = 0.0  # [s] of wall time when the link broke, or could not be opened
        self._link: Any = None
        self._open()

    def receive(self) -> list[MavlinkMessage]:
        """See `Connection.receive`."""
        messages: list[MavlinkMessage] = []
        if not self._is_open():
            return messages
        try:
            # at most a thousand messages, so that other work is not delayed
            while len(messages) < 1000 and (message := self._link.recv_msg()) is not None:
                messages.append(message)
            self._drop_closed_client()
        except OSError:
            self.close()
        return [message for message in messages if message.get_type() != "BAD_DATA"]

    def send(self, message: MavlinkMessage) -> None:
        """See `Connection.send`."""
        if self._is_open():
            try:
                self._link.mav.send(message)
            except OSError:
                self.close()

    def close(self) -> None:
        """See `Connection.close`."""
        link, self._link, self._broke = self._link, None, time.monotonic()
        if link is not None:
            with suppress(OSError):
                link.close()

    def _is_open(self) -> bool:
        """Return True for a working link; a broken link is reopened first, if the pause is over."""
        if self._link is None and time.monotonic() - self._broke > _REOPEN_TIMEOUT:
            patience = socket.getdefaulttimeout()
            socket.setdefaulttimeout(_REOPEN_TIMEOUT)
            try:
                self._open()
            except OSError:
                self._broke = time.monotonic()
            finally:
                socket.setdefaulttimeout(patience)
        return self._link is not None

    def _open(self) -> None:
        self._link = self._open_link()
        self._link.handle_eof = self._link.handle_disconnect = _end_of_link  # of TCP

    def _drop_closed_client(self) -> None:
        """Close the connection of a client that has hung up, so that a TCP server accepts the next one."""
        port = getattr(self._link, "listen", None) and self._link.port
        if port:
            with suppress(BlockingIOError):
                if not port.recv(1, socket.MSG_PEEK):
                    port.close()
                    self._link.port = None


def _end_of_link() -> None:
    raise ConnectionResetError("the other end has closed the connection")


class LossyConnection:
    """A connection that loses some messages in both directions and delays all others equally."""

    def __init__(
        self, connection: Connection, clock: Clock, *, loss: float = 0.0, delay: float = 0.0, seed: int = 0
    ) -> None:
        """Wrap a connection.

        Args:
            connection: carries the messages.
            clock: of the delay.
            loss: the probability that a message is lost, in either direction.
            delay: of each message, in either direction [s].
            seed: of the losses.
        """
        self._connection = connection
        self._clock = clock
        self._loss, self._delay = loss, delay
        self._random = np.random.default_rng(seed)
        self._coming: deque[tuple[float, MavlinkMessage]] = deque()  # [s] when each is due
        self._going: deque[tuple[float, MavlinkMessage]] = deque()

    def receive(self) -> list[MavlinkMessage]:
        """See `Connection.receive`; also sends messages whose delay is over."""
        for message in self._connection.receive():
            self._keep(self._coming, message)
        for message in self._due(self._going):
            self._connection.send(message)
        return self._due(self._coming)

    def send(self, message: MavlinkMessage) -> None:
        """See `Connection.send`."""
        self._keep(self._going, message)

    def close(self) -> None:
        """See `Connection.close`."""
        self._connection.close()

    def _keep(self, queue: deque[tuple[float, MavlinkMessage]], message: MavlinkMessage) -> None:
        if self._random.random() >= self._loss:
            queue.append((self._clock.now() + self._delay, message))

    def _due(self, queue: deque[tuple[float, MavlinkMessage]]) -> list[MavlinkMessage]:
        due = []
        while queue and queue[0][0] <= self._clock.now():
            due.append(queue.popleft()[1])
        return due
