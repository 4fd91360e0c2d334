"""Workers of a study: this process, processes of its own, a Dask cluster, or whatever an executor has.

A study hands its parts to a `Pool`. Parts say everything that their results depend on, so that neither the
number of workers nor their order changes a bit. A part whose worker dies is done again.
"""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import pickle
import re
import signal
import sys
import threading
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property, lru_cache
from multiprocessing.connection import Connection
from typing import Annotated, Any, TypeVar

from pydantic import Field, PlainValidator

from aerobat.declaration import FieldError, shown
from aerobat.declaration.registry import import_plugin, imported_plugins
from aerobat.engines.engine import available_cores
from aerobat.errors import SpecError, import_extra
from aerobat.provenance import installed_versions

MAX_WORKERS = 4096
WORKERS = f"whole number from 1 to {MAX_WORKERS}, or dask://HOST:PORT"
MAX_DEATHS = 3  # of workers, one after another without any part done, after which the parts are too much
LIBRARIES = ("aerobat", "numpy", "scipy", "llvmlite", "jax")  # that numbers come from
_QUEUED = 2  # groups of parts for each worker: one that it works at, and the next
_QUEUED_ELSEWHERE = 256  # groups, for an executor that does not say how many workers it has
_SHARES = 4  # groups at least that each worker gets of a study's parts, so that all end about together
_WORKERS_ELSEWHERE = 16  # where an executor does not say how many it has
_CONNECTING = 10.0  # [s] within which a scheduler answers
_DASK = re.compile(r"dask://([^\s/:]+|\[[0-9a-fA-F:]+\]):(\d{1,5})")

Task = TypeVar("Task")
Part = TypeVar("Part")
Found = TypeVar("Found")


def read_workers(value: Any) -> int | str:
    """Read a number of processes, or the address of a scheduler. Raises FieldError for what is neither."""
    if isinstance(value, str) and _DASK.fullmatch(value):
        return value
    is_number = isinstance(value, int | str) and not isinstance(value, bool) and str(value).isdecimal()
    if not is_number or not 1 <= int(value) <= MAX_WORKERS:
        raise FieldError("", f"must be a {WORKERS}, got {shown(value)}")
    return int(value)


Workers = Annotated[
    int | str,
    PlainValidator(read_workers),
    Field(description=WORKERS),
]


class WorkerEnded(SpecError):
    """A process that plans or flies was killed, or ended by itself."""


class Pool:
    """The workers that do a study's parts; see `pool`."""

    def __init__(self, count: int = 1, executor: Executor | None = None) -> None:
        """Take an executor of about so many workers, else so many processes, of which one is this process."""
        self._count = count
        self._given = executor
        self._own = ExitStack()
        self._started: Executor | None = None
        self._pending: dict[Future[list[Any]], list[Any]] = {}

    def results(
        self,
        function: Callable[[Task, Part], Found],
        task: Task,
        parts: Iterable[Part],
        *,
        together: int = 1,
        compiles: bool = False,
    ) -> Iterator[tuple[Part, Found]]:
        """Yield each part with its result, in the order in which they are done.

        Args:
            function: What is done, a function that other processes can import.
            task: What all parts share; each worker is told once.
            parts: What is to be done; a deque may grow while results are read.
            together: How many parts at most are handed to a worker at once, where they are quick.
            compiles: True where this process does the first part before it is copied, so that its copies
                have what that compiled.

        Raises WorkerEnded where workers die over and over, and whatever the function raises.
        """
        waiting = parts if isinstance(parts, deque) else deque(parts)
        while waiting and (self.is_here or (compiles and self._given is None and self._started is None)):
            part = waiting.popleft()
            yield part, function(task, part)
            compiles = False
        size = min(max(len(waiting) // (_SHARES * self._count), 1), together)
        shared = _Shared(task)
        deaths = 0
        while waiting:
            try:
                while waiting or self._pending:
                    self._submit(function, shared, waiting, size)
                    for future in wait(self._pending, return_when=FIRST_COMPLETED).done:
                        found = future.result()
                        done = self._pending.pop(future)
                        deaths = 0
                        yield from zip(done, found, strict=True)
            except Exception as error:
                if not _is_death(error):
                    raise
                deaths += 1
                if self._given is not None or deaths == MAX_DEATHS:
                    raise self._too_many_deaths() from None
                waiting.extendleft(part for group in self._pending.values() for part in reversed(group))
                self._pending.clear()
                self.close()

    @property
    def is_here(self) -> bool:
        """True where this process does all parts."""
        return self._given is None and self._count == 1

    def close(self) -> None:
        """End the pool's own processes, and what an executor has not begun."""
        self.__exit__(None, None, None)

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *error: Any) -> None:
        for future in self._pending:
            future.cancel()
        self._started = None
        self._own.__exit__(*error)

    def _submit(
        self, function: Callable[[Any, Any], Any], shared: _Shared, waiting: deque[Any], size: int
    ) -> None:
        """Hand on groups of parts, as many as keep all workers at work."""
        executor = self._executor()
        queued = _QUEUED_ELSEWHERE if self._given is not None else _QUEUED * self._count
        while waiting and len(self._pending) < queued:
            group = [waiting.popleft() for _ in range(min(size, len(waiting)))]
            try:
                self._pending[executor.submit(_done, function, shared, group)] = group
            except BaseException:
                waiting.extendleft(reversed(group))
                raise

    def _executor(self) -> Executor:
        if self._given is not None:
            return self._given
        if self._started is None:
            self._started = self._own.enter_context(processes(self._count, forked=True))
        return self._started

    def _too_many_deaths(self) -> WorkerEnded:
        below = ""
        if self._given is None and not _can_fork():
            below = '; a script calls it below `if __name__ == "__main__":`, or with workers=1'
        return WorkerEnded(
            "worker processes were killed or have ended by themselves; where memory is short, take fewer "
            f"workers{below}"
        )


@contextmanager
def pool(
    workers: int | str | None, executor: Executor | None = None, parts: int = MAX_WORKERS
) -> Iterator[Pool]:
    """Give the workers of a study, and end them with it, however it ends.

    Args:
        workers: A number of processes, by default one a core; or a Dask scheduler, as dask://HOST:PORT.
        executor: What works instead.
        parts: The number of parts, more processes than which would have nothing to do.

    Raises SpecError where no scheduler answers, and BackendMissing where Dask is not installed.
    """
    if executor is None and isinstance(workers, str):
        with _dask_pool(workers) as made:
            yield made
        return
    count = workers if isinstance(workers, int) else available_cores()
    with Pool(max(min(count, parts), 1) if executor is None else _WORKERS_ELSEWHERE, executor) as made:
        yield made


@contextmanager
def _dask_pool(address: str) -> Iterator[Pool]:
    """The workers of a scheduler."""
    dask = import_extra("distributed", f"workers {address} need dask.distributed", "aerobat[cluster]")
    try:
        client = dask.Client(address.replace("dask://", "tcp://"), timeout=_CONNECTING, set_as_default=False)
    except OSError:
        raise SpecError(
            f"workers: no scheduler answers at {address}; start one with `dask scheduler`, and workers with "
            "`dask worker`"
        ) from None
    with client, Pool(max(sum(client.nthreads().values()), 1), client.get_executor()) as made:
        yield made


def _is_death(error: BaseException) -> bool:
    """True where an executor says that a worker died; of Dask, that one did wherever a part went."""
    dask = sys.modules.get("distributed")
    return isinstance(error, BrokenExecutor if dask is None else (BrokenExecutor, dask.KilledWorker))


@dataclass(frozen=True, eq=False)
class _Shared:
    """What all parts share, which a worker unpacks once however many of them it does."""

    task: Any

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpacked, (self._packed, imported_plugins(), _versions())

    @cached_property
    def _packed(self) -> bytes:
        packed = pickle.dumps(self.task)
        if b"__main__" in packed and "cloudpickle" in sys.modules:  # no other machine has that script
            packed = sys.modules["cloudpickle"].dumps(self.task)
        return packed


@lru_cache(maxsize=1)
def _versions() -> tuple[tuple[str, str], ...]:
    """The libraries that numbers come from, with their versions."""
    return tuple(installed_versions(LIBRARIES).items())


@lru_cache(maxsize=4)
def _unpacked(packed: bytes, plugins: tuple[str, ...], versions: tuple[tuple[str, str], ...]) -> _Shared:
    """Raises SpecError in a process whose numbers might be others."""
    if _versions() != versions:
        theirs, mine = (", ".join(map(" ".join, each)) for each in (versions, _versions()))
        raise SpecError(f"workers: one has {mine}, and not {theirs}; install the same versions for all")
    for path in plugins:
        import_plugin(path)
    return _Shared(pickle.loads(packed))


def _done(function: Callable[[Any, Any], Any], shared: _Shared, parts: list[Any]) -> list[Any]:
    return [function(shared.task, part) for part in parts]


def _can_fork() -> bool:
    """True on Linux without JAX: libraries of macOS do not survive forks, and JAX's locks no fork frees."""
    return sys.platform == "linux" and "jax" not in sys.modules


def _return_freed_memory() -> None:
    """Give back to the system what a compiler has freed, which every copy of this process would hold too."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # of glibc alone
    if trim is not None:
        trim(0)


@contextmanager
def processes(count: int, forked: bool) -> Iterator[ProcessPoolExecutor]:
    """Give so many processes, which end with the block.

    An exception in the block, Ctrl-C among them, ends them at once, as does the death of this process: each
    watches one end of a pipe. Raises WorkerEnded where one is killed or ends by itself.

    Args:
        count: How many.
        forked: True for copies of this process, where the system has such, that share its memory and its
            compiled code; else each imports and compiles its own.
    """
    context: Any = multiprocessing.get_context("fork" if forked and _can_fork() else "spawn")
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
        raise WorkerEnded("a worker process was killed or has ended by itself") from None
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
