"""ROS of either generation, as the nodes here use it: its calls come one after the other, in one thread."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future
from importlib import import_module
from math import inf
from queue import Empty, Queue
from typing import Any, Protocol, TypeAlias

from aerobat.errors import SpecError
from aerobat.interchange.ros import NANOSECONDS

Answer: TypeAlias = Callable[[bool, str], None]  # success, and a sentence

QUEUE = 1000  # messages that wait for a slow receiver: ten seconds of goals
NEWEST = 5  # messages of which not every one counts

_PATIENCE = 5.0  # [s] of the wall, for which a clock waits
_FIRST_TIME = 20.0  # [s] of the wall, for which somebody who tells the time is waited for
_TOLD_AGAIN = 0.1  # [s] of the wall, after which a clock that waits tells its time once more
_MAX_STEP = 0.01  # [s] between two looks at a clock that waits, its own process' being held up among it
_MAX_WAIT, _MIN_WAIT = 0.005, 0.0002  # [s] between looks at a clock that may run at another pace than ours


def interface_class(kind: str) -> Any:
    """The class of messages or services of a kind, package/msg/Name or package/srv/Name, of the ROS at hand.

    Raises SpecError where its package is not there.
    """
    package, folder, name = kind.split("/")
    try:
        return getattr(import_module(f"{package}.{folder}"), name)
    except ImportError as error:
        raise SpecError(f"{package} is not found ({error}); source the workspace that has built it") from None


class PacedClock:
    """A clock that other nodes follow, `speed` times as fast as the wall's, whose time it begins with.

    It waits for nodes that are late, its own among them, so that a flight is the same on a busy machine.
    While it waits, its last time is sent again: a late node may have missed the message by which to go on.
    """

    def __init__(self, speed: float) -> None:
        self.tell_again: Callable[[], None] = lambda: None  # sends the last time to others
        self._speed = speed
        self._began = time.time_ns()
        self._elapsed = 0.0  # [ns] of this clock
        self._looked = self._asked = self._told = time.monotonic()
        self._end = inf  # [ns] of `_elapsed`, to be waited at

    def time(self) -> int:
        """The time [ns]."""
        wall = time.monotonic()
        passed = min(self._speed * (wall - self._looked), _MAX_STEP)
        further = self._elapsed + NANOSECONDS * passed
        waits = wall - self._asked < _PATIENCE
        self._elapsed = min(further, max(self._end, self._elapsed)) if waits else further
        self._looked = wall
        if self._elapsed < further and wall - self._told > _TOLD_AGAIN:
            self._told = wall
            self.tell_again()
        return self._began + round(self._elapsed)

    def wait_at(self, instant: int) -> None:
        """Go no further than to a time [ns], until asked again or for as long as patience lasts."""
        self.time()
        self._end, self._asked = float(instant - self._began), self._looked


class Middleware(Protocol):
    """A node's access to ROS."""

    def make(self, kind: str, /, **given: Any) -> Any:
        """A message of a kind; see `interchange.ros.Make`."""

    def time(self) -> int:
        """ROS time [ns]."""

    def publisher(self, topic: str, kind: str, latched: bool = False) -> Callable[[Any], None]:
        """Announce a topic; what sends a message to it. Latched, the last one reaches who comes later."""

    def subscribe(self, topic: str, kind: str, take: Callable[[Any], None], every: bool = True) -> None:
        """Have messages of a topic taken, in order: `every` one, or where they come too fast the newest."""

    def offer(self, service: str, take: Callable[[Answer], None]) -> None:
        """Offer a service of std_srvs/Trigger; what takes a request answers it, now or later."""

    def work_until(self, instant: int, patience: float = inf) -> None:
        """Do what comes, messages and requests, until a time [ns] or for so long [s] of the wall."""

    def close(self) -> None:
        """Leave the graph."""


def require_time(clock: Callable[[], int]) -> None:
    """Wait for simulated time to begin. Raises SpecError where nobody tells it."""
    end = time.monotonic() + _FIRST_TIME
    while clock() == 0:
        if time.monotonic() > end:
            raise SpecError("ROS time is simulated, but nobody tells it on /clock; start the simulator first")
        time.sleep(_MAX_WAIT)


class Calls:
    """Calls that the threads of ROS ask for, done by the thread that `work`s."""

    def __init__(self) -> None:
        # no SimpleQueue: its `get` may wait for ever where a busy machine lets a short timeout pass within it
        self._waiting: Queue[Callable[[], None]] = Queue()
        self._unanswered: set[Future[tuple[bool, str]]] = set()

    def put(self, call: Callable[[], None]) -> None:
        """Have it done soon."""
        self._waiting.put(call)

    def answer(self, take: Callable[[Answer], None]) -> tuple[bool, str]:
        """Have a request taken, and wait for its answer."""
        answered: Future[tuple[bool, str]] = Future()
        self._unanswered.add(answered)
        self.put(lambda: take(lambda success, sentence: self._settle(answered, success, sentence)))
        return answered.result()

    def close(self) -> None:
        """Answer whoever still waits."""
        for answered in tuple(self._unanswered):
            self._settle(answered, False, "the node has ended")

    def _settle(self, answered: Future[tuple[bool, str]], success: bool, sentence: str) -> None:
        if answered in self._unanswered:
            self._unanswered.discard(answered)
            answered.set_result((success, sentence))

    def work_until(self, instant: int, clock: Callable[[], int], patience: float = inf) -> None:
        """Do calls, those that wait in any case, until a time [ns] or for so long [s] of the wall."""
        end = time.monotonic() + patience
        for _ in range(self._waiting.qsize()):
            self._waiting.get()()
        while (remaining := (instant - clock()) / NANOSECONDS) > 0.0 and time.monotonic() < end:
            try:
                call = self._waiting.get(timeout=min(max(remaining, _MIN_WAIT), _MAX_WAIT))
            except Empty:
                continue
            call()
