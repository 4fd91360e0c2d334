"""Ctrl-C while a solver runs that swallows it."""

from __future__ import annotations

import io
import signal
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr
from types import FrameType


@contextmanager
def interrupts_kept() -> Iterator[None]:
    """Raise KeyboardInterrupt when the block ends if a signal raised it within, whatever became of it there.

    CasADi lets Python handle its signals in the middle of a solve, then takes the exception for a failure of
    the program: the answer would be told as one. What it says of that is dropped. Outside the main thread,
    where Python handles no signals, there is nothing to keep.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handler = signal.getsignal(signal.SIGINT)
    if not callable(handler):  # ignored, or the system's own: no exception comes of either
        yield
        return
    interrupts: list[KeyboardInterrupt] = []
    with ExitStack() as stack:

        def keep(signum: int, frame: FrameType | None) -> None:
            try:
                handler(signum, frame)
            except KeyboardInterrupt as interrupt:
                interrupts.append(interrupt)
                stack.enter_context(redirect_stderr(io.StringIO()))
                raise

        signal.signal(signal.SIGINT, keep)
        stack.callback(signal.signal, signal.SIGINT, handler)
        try:
            yield
        finally:
            if interrupts:
                raise KeyboardInterrupt from None
