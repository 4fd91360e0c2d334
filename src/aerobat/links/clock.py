"""Clocks of live links, which need not show the time of the wall."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """A clock to read and to wait by."""

    def now(self) -> float:
        """The time [s] since the clock began."""

    def sleep_until(self, instant: float) -> None:
        """Wait until this time [s], not at all where it has passed."""


class WallClock:
    """The wall's time, `speed` times as fast; one below 1 gives a slow machine more time for each tick."""

    def __init__(self, speed: float = 1.0) -> None:
        self._speed = speed
        self._began = time.monotonic()

    def now(self) -> float:
        """See `Clock.now`."""
        return self._speed * (time.monotonic() - self._began)

    def sleep_until(self, instant: float) -> None:
        """See `Clock.sleep_until`."""
        time.sleep(max(instant - self.now(), 0.0) / self._speed)
