"""A limit of time for all that is solved within a block, however deep."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from math import inf
from time import perf_counter as clock

_deadline: ContextVar[float] = ContextVar("deadline", default=inf)  # [s] of the clock


@contextmanager
def within_time(limit: float | None) -> Iterator[None]:
    """Give all that runs in the block so much time [s], or what an outer block has left; None adds no limit.

    Solvers end early by themselves; what calls them again and again asks `out_of_time`.
    """
    end = inf if limit is None else clock() + limit
    token = _deadline.set(min(end, _deadline.get()))
    try:
        yield
    finally:
        _deadline.reset(token)


def time_left() -> float | None:
    """The time that is left [s], zero where it is over; None without a limit."""
    end = _deadline.get()
    return None if end == inf else max(end - clock(), 0.0)


def out_of_time() -> bool:
    """True where a limit is over."""
    return time_left() == 0.0


def shorter(limit: float | None) -> float | None:
    """The shorter of a solver's own limit [s] and the time that is left; None where there is neither."""
    limits = [each for each in (limit, time_left()) if each is not None]
    return min(limits, default=None)
