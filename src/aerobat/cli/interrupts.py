"""Ctrl-C and SIGTERM, from the start of a run until its results are in place."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from types import FrameType

from aerobat.cli.failures import ExitCode

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
REPORTED = "reported"  # argument of an interrupt after which no failure is printed as JSON: a report was
_noticed: list[int] = []


@contextmanager
def interruptible(afterwards: bool) -> Iterator[None]:
    """Have SIGINT and SIGTERM raise KeyboardInterrupt in the block, even where the exception is swallowed.

    A signal is remembered, and any later failure counts as caused by it: extensions written in C turn the
    exception into others. Where Python can raise nothing, as in `__del__` and the callbacks of weak
    references, it is raised right after.

    Args:
        afterwards: Whether the process goes on when the block ends; if not, signals are ignored from there.
    """
    _noticed.clear()
    hook = sys.unraisablehook
    sys.unraisablehook = partial(_raise_later, hook)
    handlers = {number: signal.signal(number, _notice) for number in _SIGNALS}
    try:
        yield
    except Exception:
        if _noticed:
            raise KeyboardInterrupt from None
        raise
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler or signal.SIG_DFL if afterwards else signal.SIG_IGN)
        sys.unraisablehook = hook


def end_interrupts() -> None:
    """Ignore signals from here on. Raises KeyboardInterrupt if one came before."""
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    if _noticed:
        raise KeyboardInterrupt


def is_interrupted() -> bool:
    """True if a signal came, whatever became of the exception that it raised."""
    return bool(_noticed)


def interrupted_by() -> ExitCode:
    """Return the exit code of an interrupted run, by the signal that came."""
    return ExitCode.TERMINATED if signal.SIGTERM in _noticed else ExitCode.INTERRUPTED


def _notice(signum: int, frame: object) -> None:
    _noticed.append(signum)
    raise KeyboardInterrupt


def _raise_later(
    hook: Callable[[sys.UnraisableHookArgs], object], unraisable: sys.UnraisableHookArgs
) -> None:
    """Have an interrupt that Python swallowed raised at the next call or return; leave the rest to `hook`.

    The signal cannot be sent again: it would be handled in here, from where nothing can be raised either.
    """
    if _noticed and unraisable.exc_type is KeyboardInterrupt:
        sys.setprofile(_raise_outside)
    else:
        hook(unraisable)


def _raise_outside(frame: FrameType, event: str, argument: object) -> None:
    if frame.f_code is not _raise_later.__code__:
        raise KeyboardInterrupt  # upon which Python calls this no more
