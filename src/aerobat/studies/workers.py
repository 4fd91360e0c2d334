"""Workers of a study: this process, processes of its own, a Dask cluster, or the workers of an executor.

A study hands its parts to a `Pool`. The result of a part depends on the part and the shared task alone, so
that neither the number of workers nor their order changes a bit. A part whose worker dies is repeated.
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
from aerobat.engines.engine import available_cores
from aerobat.errors import SpecError, import_extra
from aerobat.provenance import installed_versions
from aerobat.registry import import_plugin, imported_plugins

MAX_WORKERS = 4096
WORKERS = f"whole number from 1 to {MAX_WORKERS}, or dask://HOST:PORT"
MAX_DEATHS = 3  # consecutive deaths of workers, without a finished part, that end a study
LIBRARIES = ("aerobat", "numpy", "scipy", "llvmlite", "jax")  # whose versions change numbers
_GROUPS_PER_WORKER = 4  # least number of groups per worker, so that all workers end at about the same time
_WORKERS_ELSEWHERE = 16  # assumed number of workers of an executor that does not report it
_CONNECT_TIMEOUT = 10.0  # [s] time within which a scheduler must answer
_DASK = re.compile(r"dask://([^\s/:]+|\[[0-9a-fA-F:]+\]):(\d{1,5})")

Task = TypeVar("Task")
Part = TypeVar("Part")
Found = TypeVar("Found")


def read_workers(value: Any) -> int | str:
    """Read a number of processes, or the address of a scheduler. Raises FieldError for anything else."""
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
    """A worker process was killed, or ended by itself."""


class Pool:
    """The workers that process a study's parts; see `pool`."""

    def __init__(self, count: int = 1, executor: Executor | None = None) -> None:
        """Use an executor of about `count` workers, or else `count` processes; 1 is this process alone."""
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
        """Yield each part with its result, in the order in which they finish.

        Args:
            function: The function to call, which other processes can import.
            task: The data that all parts share, sent to each worker once.
            parts: The parts; a deque may grow while results are read.
            together: The largest number of parts sent to a worker at once, for quick parts.
            compiles: True if this process does the first part before it is forked, so that its copies have
                the compiled code.

        Raises WorkerEnded where workers die repeatedly, and whatever the function raises.
        """
        waiting = parts if isinstance(parts, deque) else deque(parts)
        while waiting and (self.is_here or (compiles and self._given is None and self._started is None)):
            part = waiting.popleft()
            yield part, function(task, part)
            compiles = False
        size = min(max(len(waiting) // (_GROUPS_PER_WORKER * self._count), 1), together)
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
        """End the pool's own processes, and cancel parts that an executor has not begun."""
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
        """Submit groups of parts, enough to keep all workers busy."""
        executor = self._executor()
        # two groups for each worker, in progress and next; more for an executor of unknown size
        queued = 256 if self._given is not None else 2 * self._count
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
    """Give the workers of a study, and end them when the block ends.

    Args:
        workers: A number of processes, by default one a core; or a Dask scheduler, as dask://HOST:PORT.
        executor: An executor that works instead.
        parts: The number of parts, which limits the number of processes.

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
    """Give the workers of a scheduler."""
    dask = import_extra("distributed", f"workers {address} need dask.distributed", "aerobat[cluster]")
    try:
        client = dask.Client(
            address.replace("dask://", "tcp://"), timeout=_CONNECT_TIMEOUT, set_as_default=False
        )
    except OSError:
        raise SpecError(
            f"workers: no scheduler answers at {address}; start one with `dask scheduler`, and workers with "
            "`dask worker`"
        ) from None
    with client, Pool(max(sum(client.nthreads().values()), 1), client.get_executor()) as made:
        yield made


def _is_death(error: BaseException) -> bool:
    """True for an executor's error that a worker died, or, of Dask, that every worker with the part died."""
    dask = sys.modules.get("distributed")
    return isinstance(error, BrokenExecutor if dask is None else (BrokenExecutor, dask.KilledWorker))


@dataclass(frozen=True, eq=False)
class _Shared:
    """The data that all parts share; a worker unpickles it once for all of its parts."""

    task: Any

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpacked, self._packed

    def __dask_tokenize__(self) -> Any:  # Dask would walk through the whole task for each group of parts
        return self._packed

    @cached_property
    def _packed(self) -> tuple[bytes, tuple[str, ...], tuple[tuple[str, str], ...]]:
        """The arguments of `_unpacked`."""
        packed = pickle.dumps(self.task)
        if b"__main__" in packed and "cloudpickle" in sys.modules:  # other machines do not have that script
            packed = sys.modules["cloudpickle"].dumps(self.task)
        return packed, imported_plugins(), _versions()


@lru_cache(maxsize=1)
def _versions() -> tuple[tuple[str, str], ...]:
    """Return the libraries that the numbers depend on, with their versions."""
    return tuple(installed_versions(LIBRARIES).items())


@lru_cache(maxsize=4)
def _unpacked(packed: bytes, plugins: tuple[str, ...], versions: tuple[tuple[str, str], ...]) -> _Shared:
    """Return the unpickled data. Raises SpecError in a process with other versions of the libraries."""
    if _versions() != versions:
        theirs, mine = (", ".join(map(" ".join, each)) for each in (versions, _versions()))
        raise SpecError(f"workers: one has {mine}, and not {theirs}; install the same versions for all")
    for path in plugins:
        import_plugin(path)
    if "MALLOC_TRIM_THRESHOLD_" in os.environ and sys.platform == "linux":
        _keep_freed_memory()
    return _Shared(pickle.loads(packed))


def _done(function: Callable[[Any, Any], Any], shared: _Shared, parts: list[Any]) -> list[Any]:
    return [function(shared.task, part) for part in parts]


def _can_fork() -> bool:
    """Return True on Linux without JAX: macOS libraries break in forks, and JAX's locks stay locked."""
    return sys.platform == "linux" and "jax" not in sys.modules


def _keep_freed_memory() -> None:
    """Keep freed memory in a worker of Dask, which returns all above 64 KiB to the system by default.

    Every chunk of flights takes the same memory again. Its pages cost a fifth of the processor time.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)  # in glibc only
    if mallopt is not None:
        for threshold in (-1, -3):  # glibc's M_TRIM_THRESHOLD and M_MMAP_THRESHOLD
            mallopt(threshold, 32 * 2**20)  # [bytes] the largest that glibc takes for both


def _return_freed_memory() -> None:
    """Return freed memory to the system after compiling, since every fork would hold that memory too."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # in glibc only
    if trim is not None:
        trim(0)


@contextmanager
def processes(count: int, forked: bool) -> Iterator[ProcessPoolExecutor]:
    """Give `count` processes, which end with the block.

    An exception in the block, such as Ctrl-C, ends them at once, as does the death of this process: each
    process watches one end of a pipe. Raises WorkerEnded where one is killed or ends by itself.

    Args:
        count: The number of processes.
        forked: True for forks of this process, where the system supports forks, which share its memory and
            compiled code; false for new processes, each of which imports and compiles.
    """
    context: Any = multiprocessing.get_context("fork" if forked and _can_fork() else "spawn")
    if sys.platform == "linux":
        _return_freed_memory()
    watched, held = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(count, context, _begin, (watched, held, imported_plugins()))
    try:
        with warnings.catch_warnings():
            # fork beside threads: the threads of engines and BLAS handle forks, and no other thread is waited
            # for
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
    """Initialize a worker: it ignores interrupts, which its parent handles, and ends when its parent ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # a fork inherits its parent's handler
    held.close()
    threading.Thread(target=_end_with, args=(watched,), daemon=True).start()
    for path in plugins:
        import_plugin(path)


def _end_with(watched: Connection) -> None:
    """End this process when no process holds the other end of a pipe any more."""
    try:
        watched.recv()
    except (EOFError, OSError):
        os._exit(1)
