"""Processes that plan or fly, one a core: they end when the study does, however it ends."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Annotated, Any

from pydantic import Field

from aerobat.declaration.registry import import_plugin, imported_plugins
from aerobat.errors import SpecError

Workers = Annotated[int, Field(ge=1, le=4096, description="whole number from 1 to 4096")]


class WorkerEnded(SpecError):
    """A process that plans or flies was killed, or ended by itself."""


class InProcess(Executor):
    """Does what is submitted at once, in this process."""

    def submit(self, function: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """The result, done."""
        future: Future[Any] = Future()
        future.set_result(function(*args, **kwargs))
        return future


def _return_freed_memory() -> None:
    """Give back to the system what a compiler has freed, which every copy of this process would hold too."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # of glibc alone
    if trim is not None:
        trim(0)


@contextmanager
def workers(count: int, forked: bool) -> Iterator[Executor]:
    """So many processes; one is this process.

    An exception in the block, Ctrl-C among them, ends them at once, as does the death of this process: each
    watches one end of a pipe. Raises WorkerEnded where one is killed or ends by itself.

    Args:
        count: how many.
        forked: True for copies of this process, where the system has such, that share its memory and its
            compiled code; else each imports and compiles its own.
    """
    if count == 1:
        yield InProcess()
        return
    # macOS has forks that its own libraries do not survive; JAX's threads hold locks that no fork frees
    survives = sys.platform == "linux" and "jax" not in sys.modules
    context: Any = multiprocessing.get_context("fork" if forked and survives else "spawn")
    if sys.platform == "linux":
        _return_freed_memory()
    watched, held = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(count, context, _begin, (watched, held, imported_plugins()))
    try:
        with warnings.catch_warnings():
            # forked beside threads: those of engines and BLAS know of forks, and no other is waited for
            warnings.filterwarnings("ignore", ".*fork", DeprecationWarning)
            yield pool
        pool.shutdown()
    except BrokenProcessPool:
        below = 'a script calls it below `if __name__ == "__main__":`, or with workers=1'
        raise WorkerEnded(
            "a worker process was killed or has ended by itself; where memory is short, take fewer workers"
            + ("" if context.get_start_method() == "fork" else f"; {below}")
        ) from None
    finally:
        held.close()
        pool.shutdown()
        watched.close()


def _begin(watched: Connection, held: Connection, plugins: tuple[str, ...]) -> None:
    """Begin a worker: interrupts are for the process that it works for, whose end is the worker's."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # which a copy of the process would handle as that does
    held.close()
    threading.Thread(target=_end_with, args=(watched,), daemon=True).start()
    for path in plugins:
        import_plugin(path)


def _end_with(watched: Connection) -> None:
    """End this process when nobody holds the other end of a pipe any more."""
    try:
        watched.recv()
    except (EOFError, OSError):
        os._exit(1)
