"""Time limits and work limits for everything that is computed within a block.

Work counts the steps of solvers, in seconds of a reference processor. So a work limit ends at the same step
on every machine, however busy it is, and equal problems have equal plans.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from threading import local
from time import perf_counter as clock

Clock = Callable[[], float]


def wall() -> float:
    """Return the wall-clock time [s]."""
    return clock()


class _Work(local):
    """The work of a thread."""

    done = 0.0


_work = _Work()


def work() -> float:
    """Return the work of this thread's solvers [s of the reference processor]."""
    return _work.done


def count_work(seconds: float) -> None:
    """Add a step of a solver to this thread's work [s of the reference processor]."""
    _work.done += seconds


_deadlines: ContextVar[tuple[tuple[Clock, float], ...]] = ContextVar("deadlines", default=())


@contextmanager
def within_time(limit: float | None, by: Clock = wall) -> Iterator[None]:
    """Limit the time [s] of everything that runs in the block; outer limits still hold, None adds no limit.

    Solvers stop by themselves; loops that call them should check `out_of_time`.
    """
    added = () if limit is None else ((by, by() + limit),)
    with _within((*_deadlines.get(), *added)):
        yield


@contextmanager
def within_share(fraction: float) -> Iterator[None]:
    """Limit the block to a fraction of the time that is left; without an outer limit there is none."""
    begun = ((by, by(), end) for by, end in _deadlines.get())
    with _within(tuple((by, now + fraction * max(end - now, 0.0)) for by, now, end in begun)):
        yield


@contextmanager
def _within(deadlines: tuple[tuple[Clock, float], ...]) -> Iterator[None]:
    token = _deadlines.set(deadlines)
    try:
        yield
    finally:
        _deadlines.reset(token)


def time_left(*clocks: Clock) -> float | None:
    """Return the time left [s] by some clocks (default: all), at least 0; None without a limit."""
    lefts = (end - by() for by, end in _deadlines.get() if by in clocks or not clocks)
    left = min(lefts, default=None)
    return None if left is None else max(left, 0.0)


def out_of_time(*clocks: Clock) -> bool:
    """Return True after a deadline by one of some clocks (default: all)."""
    return time_left(*clocks) == 0.0
