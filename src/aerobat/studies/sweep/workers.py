"""Processes that fly, one a core: they end when the sweep does, however it ends."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any

from aerobat.declaration.registry import import_plugin, imported_plugins
from aerobat.errors import SpecError

_PRELOADED = "aerobat.studies.sweep.flights"


class InProcess(Executor):
    """Does what is submitted at once, in this process."""

    def submit(self, function: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """The result, done."""
        future: Future[Any] = Future()
        future.set_result(function(*args, **kwargs))
        return future


@contextmanager
def workers(count: int) -> Iterator[Executor]:
    """So many processes, in which nothing is left of this one's threads and locks; one is this process.

    An exception in the block, Ctrl-C among them, ends them at once, as does the death of this process: each
    watches one end of a pipe. Raises SpecError where they end by themselves.
    """
    if count == 1:
        yield InProcess()
        return
    methods = multiprocessing.get_all_start_methods()
    context: Any = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
    if "forkserver" in methods:
        context.set_forkserver_preload([_PRELOADED])  # imported once for all of them
    watched, held = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(count, context, _begin, (watched, imported_plugins()))
    try:
        yield pool
        pool.shutdown()
    except BrokenProcessPool:
        raise SpecError(
            "a process that flies has ended by itself: its memory may be short, then take a smaller batch; "
            'and a script that sweeps does so below `if __name__ == "__main__":`, or with workers=1'
        ) from None
    finally:
        held.close()
        pool.shutdown()
        watched.close()


def _begin(watched: Connection, plugins: tuple[str, ...]) -> None:
    """Begin a worker: interrupts are for the process that sweeps, whose end is the worker's."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(watched,), daemon=True).start()
    for path in plugins:
        import_plugin(path)


def _end_with(watched: Connection) -> None:
    """End this process when nobody holds the other end of a pipe any more."""
    try:
        watched.recv()
    except (EOFError, OSError):
        os._exit(1)
