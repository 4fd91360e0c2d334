"""Ctrl-C from a run's first instant to the one from which nothing takes it back."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager

_noticed: list[int] = []


@contextmanager
def interruptible(afterwards: bool) -> Iterator[None]:
    """Have Ctrl-C raise KeyboardInterrupt and be remembered, even where something swallows the exception.

    What fails once it is remembered fails of it: extensions written in C make other exceptions of this one.

    `afterwards`: whether the process goes on when the block ends; if not, Ctrl-C means nothing from there.
    """
    _noticed.clear()
    handler = signal.signal(signal.SIGINT, _notice)
    try:
        yield
    except Exception:
        if _noticed:
            raise KeyboardInterrupt from None
        raise
    finally:
        signal.signal(signal.SIGINT, handler if afterwards else signal.SIG_IGN)


def end_interrupts() -> None:
    """Let nothing interrupt what follows. Raises KeyboardInterrupt where something has before."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if _noticed:
        raise KeyboardInterrupt


def _notice(signum: int, frame: object) -> None:
    _noticed.append(signum)
    raise KeyboardInterrupt
