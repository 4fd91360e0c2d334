"""Ctrl-C and SIGTERM from a run's first instant to the one from which nothing takes it back."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from types import FrameType

from aerobat.cli.failures import ExitCode

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
REPORTED = "reported"  # of an interrupt whose command has written its report: nothing else is JSON then
_noticed: list[int] = []


@contextmanager
def interruptible(afterwards: bool) -> Iterator[None]:
    """Have either raise KeyboardInterrupt and be remembered, even where something swallows the exception.

    What fails once it is remembered fails of it: extensions written in C make other exceptions of this one.
    Where Python can raise nothing, as in `__del__` and weak references' callbacks, it is raised right after.

    `afterwards`: whether the process goes on when the block ends; if not, they mean nothing from there.
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
    """Let nothing interrupt what follows. Raises KeyboardInterrupt where something has before."""
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    if _noticed:
        raise KeyboardInterrupt


def is_interrupted() -> bool:
    """True where a signal came, whatever became of the exception that it raised."""
    return bool(_noticed)


def interrupted_by() -> ExitCode:
    """Return what a run that was interrupted comes to, by the signal that did it."""
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
