"""The interface to ROS 1 and ROS 2 for the nodes here: callbacks run one after the other, in one thread."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from importlib import import_module
from math import inf
from queue import Empty, Queue
from typing import Any, TypeAlias

from aerobat.errors import SpecError
from aerobat.interchange.ros import NANOSECONDS

Answer: TypeAlias = Callable[[bool, str], None]  # arguments: success, and a sentence

QUEUE = 1000  # messages that may wait for a slow receiver: ten seconds of goals
NEWEST = 5  # messages that may wait if only the newest matter

_WAIT_TIMEOUT = 5.0  # [s] of wall time, longest wait of a clock
_START_TIMEOUT = 20.0  # [s] of wall time, longest wait for simulated time to begin
_RESEND_INTERVAL = 0.1  # [s] of wall time, after which a waiting clock sends its time again
_MAX_STEP = 0.01  # [s] largest step of a waiting clock between two reads, delays of its own process included
_MAX_WAIT, _MIN_WAIT = 0.005, 0.0002  # [s] between reads of a clock that may not run at wall time


def interface_class(kind: str) -> Any:
    """Return the class of messages or services of a kind, package/msg/Name or package/srv/Name.

    Raises SpecError where its package is not found.
    """
    package, folder, name = kind.split("/")
    try:
        return getattr(import_module(f"{package}.{folder}"), name)
    except ImportError as error:
        raise SpecError(f"{package} is not found ({error}); source the workspace that has built it") from None


class PacedClock:
    """A clock that other nodes follow, `speed` times as fast as wall time, with which it begins.

    It waits for late nodes, its own node included, so that a flight is the same on a busy machine. While it
    waits, its last time is sent again, since a late node may have missed the message that it needs to go on.
    """

    def __init__(self, speed: float) -> None:
        self.resend: Callable[[], None] = lambda: None  # sends the last time to other nodes
        self._speed = speed
        self._began = time.time_ns()
        self._elapsed = 0.0  # [ns] of this clock
        self._last_read = self._wait_began = self._last_sent = time.monotonic()
        self._end = inf  # [ns] value of `_elapsed` at which the clock waits

    def time(self) -> int:
        """Return the time [ns]."""
        wall = time.monotonic()
        passed = min(self._speed * (wall - self._last_read), _MAX_STEP)
        further = self._elapsed + NANOSECONDS * passed
        waits = wall - self._wait_began < _WAIT_TIMEOUT
        self._elapsed = min(further, max(self._end, self._elapsed)) if waits else further
        self._last_read = wall
        if self._elapsed < further and wall - self._last_sent > _RESEND_INTERVAL:
            self._last_sent = wall
            self.resend()
        return self._began + round(self._elapsed)

    def wait_at(self, instant: int) -> None:
        """Stop the clock at a time [ns] until the next call, or for _WAIT_TIMEOUT at most."""
        self.time()
        self._end, self._wait_began = float(instant - self._began), self._last_read


class Middleware(ABC):
    """A node's access to ROS of either generation, its clock, and calls that threads of ROS request.

    The thread that runs `work_until` executes the calls.
    """

    def __init__(self, clock: PacedClock | None) -> None:
        self._clock = clock  # None for ROS time
        # not SimpleQueue: on a busy machine its `get` may wait for ever if a short timeout passes within it
        self._calls: Queue[Callable[[], None]] = Queue()
        self._unanswered: set[Future[tuple[bool, str]]] = set()

    @abstractmethod
    def make(self, kind: str, /, **given: Any) -> Any:
        """Return a message of a kind; see `interchange.ros.Make`."""

    @abstractmethod
    def ros_time(self) -> int:
        """Return the time that ROS tells [ns]."""

    @abstractmethod
    def publisher(self, topic: str, kind: str, latched: bool = False) -> Callable[[Any], None]:
        """Announce a topic and return its publishing function; latched: late subscribers get the last."""

    @abstractmethod
    def subscribe(self, topic: str, kind: str, take: Callable[[Any], None], every: bool = True) -> None:
        """Subscribe to a topic; messages are processed in order: `every` message, or only the newest ones."""

    @abstractmethod
    def offer(self, service: str, take: Callable[[Answer], None]) -> None:
        """Offer a std_srvs/Trigger service; `take` receives a function to answer with, now or later."""

    def time(self) -> int:
        """Return the time of the node's clock, by default ROS time [ns]."""
        return self.ros_time() if self._clock is None else self._clock.time()

    def require_time(self) -> None:
        """Wait for simulated time to begin. Raises SpecError where no node publishes it."""
        end = time.monotonic() + _START_TIMEOUT
        while self.time() == 0:
            if time.monotonic() > end:
                raise SpecError(
                    "ROS time is simulated, but nobody tells it on /clock; start the simulator first"
                )
            time.sleep(_MAX_WAIT)

    def request(self, take: Callable[[Any], None], message: Any) -> None:
        """Request a call with a message."""
        self._calls.put(lambda: take(message))

    def answer(self, take: Callable[[Answer], None]) -> tuple[bool, str]:
        """Request a service call, and wait for its answer."""
        answered: Future[tuple[bool, str]] = Future()
        self._unanswered.add(answered)
        self.request(take, partial(self._settle, answered))
        return answered.result()

    def close(self) -> None:
        """Answer all waiting requests, and shut the node down."""
        for answered in tuple(self._unanswered):
            self._settle(answered, False, "the node has ended")

    def _settle(self, answered: Future[tuple[bool, str]], success: bool, sentence: str) -> None:
        if answered in self._unanswered:
            self._unanswered.discard(answered)
            answered.set_result((success, sentence))

    def work_until(self, instant: int, patience: float = inf) -> None:
        """Process messages and requests until a time [ns], or for `patience` [s] of wall time.

        Those that wait already are processed in any case.
        """
        end = time.monotonic() + patience
        for _ in range(self._calls.qsize()):
            self._calls.get()()
        while (remaining := (instant - self.time()) / NANOSECONDS) > 0.0 and time.monotonic() < end:
            try:
                call = self._calls.get(timeout=min(max(remaining, _MIN_WAIT), _MAX_WAIT))
            except Empty:
                continue
            call()
