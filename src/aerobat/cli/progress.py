"""Progress of long work: always visible on a terminal, in a pipe a line every few seconds."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf, isfinite
from time import perf_counter
from typing import TYPE_CHECKING, TypeVar

from aerobat.cli.terminal import say
from aerobat.errors import SpecError
from aerobat.planning import Attempt

if TYPE_CHECKING:
    from aerobat.studies.passing import Round

PERIOD = 5.0  # [s] between lines in a pipe, unless the environment says otherwise
VARIABLE = "AEROBAT_PROGRESS"


class Progress:
    """Progress of long work, as a line.

    Args:
        doing: The kind of parts that are counted, in words.
        total: The number of all parts; 0 if it is unknown.
        clock: Returns a monotonic time [s].
        kept: The number of parts that an earlier run finished, which take this one no time.
    """

    def __init__(
        self, doing: str, total: int = 0, clock: Callable[[], float] = perf_counter, kept: int = 0
    ) -> None:
        self._clock = clock
        self._began = clock()
        self._doing, self._total, self._kept = doing, total, kept
        self._done, self._note = 0, ""

    def tell(self, done: int, note: str = "") -> None:
        """Record the number of finished parts, with a note."""
        self._done, self._note = done, note

    def step(self, note: str) -> None:
        """Record one more finished part, with a note."""
        self.tell(self._done + 1, note)

    def counting(self, name: str) -> Callable[[int, int], None]:
        """Return a callback that records the numbers of finished parts and of those with a property."""
        return lambda done, some: self.tell(done, f"{some} {name}")

    def __str__(self) -> str:
        """Return the count, the time spent, the note, and the time left."""
        spent = self._clock() - self._began
        of = f" of {self._total}" if self._total else ""
        text = f"{self._doing} {self._done}{of} in {spent:.0f} s" + (f": {self._note}" if self._note else "")
        done_now = self._done - self._kept
        if not self._total or done_now <= 0:
            return text
        return f"{text}; {(self._total - self._done) * spent / done_now:.0f} s to go"

    def __rich__(self) -> str:
        """Return the line for rich, which asks for it at every refresh, with its brackets escaped."""
        from rich.markup import escape

        return escape(str(self))


P = TypeVar("P", bound=Progress)


class PlanningProgress(Progress):
    """Progress of planning.

    Args:
        planner: The name of the planner that begins.
        clock: Returns a monotonic time [s].
    """

    def __init__(self, planner: str = "", clock: Callable[[], float] = perf_counter) -> None:
        super().__init__("planning", clock=clock)
        self.begin(planner)

    def begin(self, planner: str) -> None:
        """Start again, with another planner."""
        self._planner = planner
        self._began = self._clock()
        self._best = inf  # [s] the shortest feasible duration
        self._tried = self._rounds = 0
        self._last = self._trial = ""

    def tried(self, trial: Round) -> None:
        """Record a round of flights, after which the search for a plan starts again."""
        self._best = inf
        self._rounds += 1
        self._trial = f"; round {self._rounds}, {trial}"

    def record(self, attempt: Attempt) -> None:
        """Record a finished attempt."""
        self._tried += 1
        self._last = f"{attempt.duration:.3f} s, {attempt.outcome}"
        if attempt.feasible:
            self._best = min(self._best, attempt.duration)

    def __str__(self) -> str:
        """Return the planner, the time spent, its best duration, and its last attempt."""
        best = "no plan so far" if self._best == inf else f"{self._best:.3f} s so far"
        last = f"; attempt {self._tried}: {self._last}" if self._tried else ""
        spent, number = self._clock() - self._began, f"round {self._rounds + 1}, " if self._rounds else ""
        return f"planning with {self._planner} for {spent:.0f} s: {number}{best}{last}{self._trial}"


@contextmanager
def showing(progress: P) -> Iterator[P]:
    """Show progress during the block: live on a terminal, else as lines on standard error."""
    if sys.stderr.isatty():
        from rich.console import Console

        with Console(stderr=True).status(progress):
            yield progress
        return
    ended = threading.Event()
    teller = threading.Thread(target=tell, args=(progress, ended.wait, period()), daemon=True)
    teller.start()
    try:
        yield progress
    finally:
        ended.set()
        teller.join()


def tell(progress: Progress, wait: Callable[[float], bool], seconds: float) -> None:
    """Print a line of progress at intervals until the work ends.

    Args:
        progress: The progress.
        wait: Waits for a number of seconds, and returns true as soon as the work ends.
        seconds: The interval between lines [s].
    """
    while not wait(seconds):
        say(str(progress))


def period() -> float:
    """Return the seconds between lines. Raises SpecError where the environment gives no such number."""
    text = os.environ.get(VARIABLE, "")
    try:
        seconds = float(text or PERIOD)
    except ValueError:
        seconds = inf
    if not (isfinite(seconds) and seconds > 0.0):
        raise SpecError(f"{VARIABLE} must be a positive number of seconds between lines, got {text!r}")
    return min(seconds, threading.TIMEOUT_MAX)
