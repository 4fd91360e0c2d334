"""Progress of long work: on a terminal always, in a pipe a line on standard error every few seconds."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
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
    """Progress of long work by now, as a line."""

    def __rich__(self) -> str:
        """The line, drawn anew whenever a terminal shows it, and none of its brackets taken for markup."""
        from rich.markup import escape

        return escape(str(self))


P = TypeVar("P", bound=Progress)


class PlanningProgress(Progress):
    """Progress of planning by now.

    Args:
        planner: The name of the planner that begins.
        clock: Seconds that rise.
    """

    def __init__(self, planner: str = "", clock: Callable[[], float] = perf_counter) -> None:
        self._clock = clock
        self.begin(planner)

    def begin(self, planner: str) -> None:
        """Another planner's turn."""
        self._planner = planner
        self._began = self._clock()
        self._best = inf  # [s] the shortest duration that will do
        self._tried = 0
        self._last = ""

    def record(self, attempt: Attempt) -> None:
        """Take note of an attempt that ended."""
        self._tried += 1
        self._last = f"{attempt.duration:.3f} s, {attempt.outcome}"
        if attempt.feasible:
            self._best = min(self._best, attempt.duration)

    def __str__(self) -> str:
        """Which planner, for how long, how good so far, and what it tried last."""
        best = "no plan so far" if self._best == inf else f"{self._best:.3f} s so far"
        last = f"; attempt {self._tried}: {self._last}" if self._tried else ""
        return f"planning with {self._planner} for {self._clock() - self._began:.0f} s: {best}{last}"


class PassingProgress(PlanningProgress):
    """Progress of planning until flights pass, by now."""

    def begin(self, planner: str) -> None:
        """Another planner's turn, no round flown."""
        super().begin(planner)
        self._rounds = 0
        self._trial = ""

    def tried(self, trial: Round) -> None:
        """Take note of a round that ended; the next one is planned anew."""
        self._best = inf
        self._rounds += 1
        self._trial = str(trial)

    def __str__(self) -> str:
        """What planning is at, and what the last round came to."""
        return super().__str__() + (f"; round {self._rounds}, {self._trial}" if self._rounds else "")


class DrawingProgress(Progress):
    """The number of pictures of a video that are drawn by now."""

    def __init__(self) -> None:
        self._drawn = self._all = 0

    def record(self, drawn: int, all: int) -> None:
        """Take note of a picture that is drawn."""
        self._drawn, self._all = drawn, all

    def __str__(self) -> str:
        """How many, and of how many."""
        return (
            f"drawing the video: {self._drawn} of {self._all} pictures" if self._all else "drawing the video"
        )


class TuningProgress(Progress):
    """Progress of a search for gains by now.

    Args:
        evaluations: How many sets of gains may be tried.
    """

    def __init__(self, evaluations: int) -> None:
        self._evaluations = evaluations
        self._tried, self._cost = 0, inf

    def record(self, tried: int, cost: float) -> None:
        """Take note of how many sets of gains were tried, and of the lowest cost [m]."""
        self._tried, self._cost = tried, cost

    def __str__(self) -> str:
        """How many sets of gains, and how good the best of them is."""
        best = f", cost {100 * self._cost:.2f} cm so far" if self._tried else ""
        return f"tuning: {self._tried} of at most {self._evaluations} sets of gains{best}"


class SweepProgress(Progress):
    """Progress of a sweep by now.

    Args:
        runs: How many flights there shall be.
        clock: Seconds that rise.
    """

    def __init__(self, runs: int, clock: Callable[[], float] = perf_counter) -> None:
        self._clock = clock
        self._began = clock()
        self._runs = runs
        self._done = self._well = 0

    def record(self, done: int, well: int) -> None:
        """Take note of the flights done, and of those that went well."""
        self._done, self._well = done, well

    def __str__(self) -> str:
        """How many flights, how well, for how long, how long still."""
        spent = self._clock() - self._began
        text = f"flown {self._done} of {self._runs} in {spent:.0f} s"
        if not self._done:
            return text
        well = f"{100 * self._well / self._done:.1f} % went well"
        left = (self._runs - self._done) * spent / self._done
        return f"{text}: {well}; {left:.0f} s to go"


class MapProgress(Progress):
    """Progress of a map by now.

    Args:
        cells: How many there shall be.
        clock: Seconds that rise.
    """

    def __init__(self, cells: int, clock: Callable[[], float] = perf_counter) -> None:
        self._clock = clock
        self._began = clock()
        self._cells = cells
        self._done = self._planned = 0

    def record(self, done: int, planned: int) -> None:
        """Take note of the cells done, and of those that have a plan."""
        self._done, self._planned = done, planned

    def __str__(self) -> str:
        """How many cells, how many of them planned, for how long, how long still."""
        spent = self._clock() - self._began
        text = f"{self._done} of {self._cells} cells in {spent:.0f} s"
        if not self._done:
            return text
        left = (self._cells - self._done) * spent / self._done
        return f"{text}: {self._planned} planned; {left:.0f} s to go"


class NeedProgress(Progress):
    """The last value that was tried of each quantity."""

    def __init__(self) -> None:
        self._tried = 0
        self._last: dict[str, str] = {}

    def record(self, quantity: str, value: float, planned: bool) -> None:
        """Take note of a value that was tried."""
        self._tried += 1
        self._last[quantity] = f"{quantity} {value:.4g} {'planned' if planned else 'refused'}"

    def __str__(self) -> str:
        """How many were tried, and how the last of each quantity ended."""
        return "; ".join([f"{self._tried} plans tried", *self._last.values()])


class WhyProgress(Progress):
    """The changes that were tried where there is no plan."""

    def __init__(self) -> None:
        self._tried = self._helpful = 0
        self._last = ""

    def record(self, change: str, helps: bool) -> None:
        """Take note of a change that was tried."""
        self._tried += 1
        self._helpful += helps
        self._last = f"; {change}: {'planned' if helps else 'no plan'}"

    def __str__(self) -> str:
        """How many were tried, how many help, and the last."""
        return f"{self._tried} changes tried, {self._helpful} would help{self._last}"


class CausesProgress(Progress):
    """The trial that is planned and flown.

    Args:
        trials: How many there shall be.
    """

    def __init__(self, trials: int) -> None:
        self._trials = trials
        self._begun, self._name = 0, ""

    def begin(self, name: str) -> None:
        """Another trial's turn."""
        self._begun, self._name = self._begun + 1, name

    def __str__(self) -> str:
        """Which cause, and how many trials there are."""
        return f"{self._name} ({self._begun} of {self._trials})"


def planning_progress(planner: str = "") -> AbstractContextManager[PlanningProgress]:
    """Show what planning is at in the block."""
    return showing(PlanningProgress(planner))


@contextmanager
def showing(progress: P) -> Iterator[P]:
    """Show what is recorded in the block, by whichever way standard error has."""
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
    """Say where work is, again and again.

    Args:
        progress: Where it is.
        wait: Waits for so many seconds [s], less where the work ends: then it returns true.
        seconds: From one line to the next [s].
    """
    while not wait(seconds):
        say(str(progress))


def period() -> float:
    """The seconds between lines. Raises SpecError where the environment gives no such number."""
    text = os.environ.get(VARIABLE, "")
    try:
        seconds = float(text or PERIOD)
    except ValueError:
        seconds = inf
    if not (isfinite(seconds) and seconds > 0.0):
        raise SpecError(f"{VARIABLE} must be a positive number of seconds between lines, got {text!r}")
    return min(seconds, threading.TIMEOUT_MAX)
