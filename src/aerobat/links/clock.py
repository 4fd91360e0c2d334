"""Clocks of live links, which may differ from wall time."""

from __future__ import annotations

import time
from collections.abc import Iterator
from math import inf
from typing import Protocol


class Clock(Protocol):
    """A clock to read and to wait for."""

    def now(self) -> float:
        """Return the time [s] since the clock began."""

    def sleep_until(self, instant: float) -> None:
        """Wait until this time [s]; return at once where it has passed."""


class WallClock:
    """Wall time, `speed` times as fast; a speed below 1 gives a slow machine more time for each tick."""

    def __init__(self, speed: float = 1.0) -> None:
        self._speed = speed
        self._began = time.monotonic()

    def now(self) -> float:
        """See `Clock.now`."""
        return self._speed * (time.monotonic() - self._began)

    def sleep_until(self, instant: float) -> None:
        """See `Clock.sleep_until`."""
        time.sleep(max(instant - self.now(), 0.0) / self._speed)


def ticks(clock: Clock, rate: float, end: float = inf) -> Iterator[float]:
    """Yield the time [s] of each tick, `rate` a second, until `end` [s]; missed ticks are not made up for."""
    due, period = clock.now(), 1.0 / rate
    while due < end:
        clock.sleep_until(due)
        now = clock.now()
        yield now
        due = max(due + period, now)
