"""Whoever does the parts of a study, and whoever of them dies, the study comes to the same bits."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from test_sweep import RUNS, SEED, SPREAD, hop, whole

import aerobat as ab
from aerobat.errors import BackendMissing
from aerobat.studies import workers
from aerobat.studies.flights import CHUNK
from aerobat.studies.workers import MAX_DEATHS, Pool, WorkerEnded, pool

FLIGHTS = CHUNK + 3  # two chunks


class Elsewhere(Executor):
    """Does what is submitted as another process would: arguments and results are pickled."""

    def __init__(self) -> None:
        self.submitted = 0

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.submitted += 1
        future: Future[Any] = Future()
        called, given = pickle.loads(pickle.dumps((function, args)))
        future.set_result(pickle.loads(pickle.dumps(called(*given))))
        return future


def needed(**at_work: Any) -> list[Any]:
    of = ["ceiling", "thrust-to-weight"]
    found = ab.min_requirements("line", of=of, planner="min-snap", tolerance=0.5, **at_work)
    return [(str(each), each.trials, each.plan and each.plan.trajectory) for each in found]


def passed(**at_work: Any) -> tuple[Any, ...]:
    found = ab.plan_to_pass(
        "line",
        ab.Miqp(reserve=0.1, flies=False),
        probability=0.1,
        conditions=SPREAD,
        flights=FLIGHTS,
        fresh=FLIGHTS,
        **at_work,
    )
    return found.plan.trajectory, found.before, found.after, found.tube


def compared(**at_work: Any) -> list[Any]:
    found = ab.compare("line", "agile-quad", ["miqp", "min-snap"], **at_work).entries
    return [(each.planner, each.plan and each.plan.trajectory, each.score) for each in found]


def measured(**at_work: Any) -> list[Any]:
    late = ab.Cause("late", {"conditions.computation_delay": 0.002})
    planner = ab.Miqp(order=4, reserve=0.1, flies=False)
    options = {"planner": planner, "conditions": SPREAD, "flights": FLIGHTS}
    return [
        each.scores
        for each in ab.error_causes("half-flip", "hexarotor", [late], **options, **at_work).results
    ]


STUDIES: dict[str, Callable[..., Any]] = {
    "sweep": lambda **at_work: ab.sweep(hop(), SPREAD, FLIGHTS, SEED, **at_work),
    "map": lambda **at_work: ab.feasibility_map(
        "line", {"vehicle.mass": [0.85, 9.0]}, planner="min-snap", **at_work
    ),
    "need": needed,
    "tune": lambda **at_work: ab.tune(hop(), SPREAD, FLIGHTS, evaluations=2, **at_work),
    "pass": passed,
    "compare": compared,
    "causes": measured,
}
SLOW = ("need", "pass", "compare", "causes")


@pytest.mark.parametrize(
    "study", [pytest.param(each, marks=pytest.mark.slow if each in SLOW else ()) for each in STUDIES]
)
def test_a_study_comes_to_the_same_in_any_executor(study: str) -> None:
    elsewhere = Elsewhere()
    assert STUDIES[study](executor=elsewhere) == STUDIES[study](workers=1)
    assert elsewhere.submitted > 1


def test_a_queue_of_parts_may_grow_as_results_are_read() -> None:
    for executor in (None, Elsewhere()):
        parts, found = deque([3, 5]), []
        for part, double in Pool(executor=executor).results(_times, 2, parts):
            found.append((part, double))
            if part > 1:
                parts.append(part - 2)
        assert sorted(found) == [(1, 2), (1, 2), (3, 6), (3, 6), (5, 10)][: len(found)]
        assert len(found) == 5


def _times(factor: int, number: int) -> int:
    return factor * number


def _dies_once(mark: Path, number: int) -> int:
    """Kill this process, the first time that it is asked for the number 3."""
    if number == 3 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def _dies(parent: int, number: int) -> int:
    if os.getpid() != parent:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="there processes are ended otherwise")
def test_parts_of_a_process_that_died_are_done_again(tmp_path: Path) -> None:
    with pool(2) as done:
        found = list(done.results(_dies_once, tmp_path / "mark", range(12)))
    assert sorted(found) == [(number, number) for number in range(12)]


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="there processes are ended otherwise")
def test_where_every_process_dies_a_sentence_says_so() -> None:
    with pytest.raises(WorkerEnded, match="take fewer workers") as ended, pool(2) as done:
        list(done.results(_dies, os.getpid(), range(MAX_DEATHS)))
    assert "\n" not in str(ended.value)


@cache
def seen() -> ab.Sweep:
    """Flights under `lab`, of which many chunks are flown."""
    return ab.sweep(hop(), "lab", 24 * CHUNK, SEED, workers=1)


@contextmanager
def cluster(workers: int) -> Iterator[Any]:
    """A scheduler of Dask and so many worker processes on this machine."""
    distributed = pytest.importorskip("distributed")
    options = {"threads_per_worker": 1, "host": "127.0.0.1", "dashboard_address": None}
    with distributed.LocalCluster(n_workers=workers, **options) as found:
        yield found


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="there processes are ended otherwise")
def test_of_three_dask_workers_one_is_killed_and_no_flight_is_lost() -> None:
    with cluster(3) as found:
        first = next(iter(found.workers.values())).pid
        killed: list[int] = []

        def progress(done: int, well: int) -> None:
            if not killed:
                os.kill(first, signal.SIGKILL)
                killed.append(done)

        address = found.scheduler_address.replace("tcp://", "dask://")
        swept = ab.sweep(hop(), "lab", len(seen()), SEED, workers=address, progress=progress)
    assert 0 < killed[0] < len(seen())
    assert swept == seen()


@pytest.mark.process
@pytest.mark.skipif(sys.platform != "linux", reason="glibc's memory")
def test_flights_of_a_dask_worker_take_the_same_memory_again_and_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By Dask's default every flight of this plan waited for the system to clear eighteen pages."""
    monkeypatch.setenv("MALLOC_TRIM_THRESHOLD_", "65536")  # as Dask starts its workers
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as executor:
        ab.sweep(hop(), "lab", 1000, SEED, executor=executor)
        before = executor.submit(page_faults).result()
        ab.sweep(hop(), "lab", 1000, SEED, executor=executor)
        assert executor.submit(page_faults).result() - before < 5000


def page_faults() -> int:
    """The number of pages that this process waited for."""
    import resource  # not on Windows

    return int(resource.getrusage(resource.RUSAGE_SELF).ru_minflt)


@pytest.mark.process
@pytest.mark.peer
def test_a_cluster_is_handed_in_as_an_executor() -> None:
    distributed = pytest.importorskip("distributed")
    with cluster(2) as found, distributed.Client(found) as client:
        executor = client.get_executor()
        assert ab.sweep(hop(), SPREAD, RUNS, SEED, executor=executor) == whole()
        for study in ("map", "compare"):
            assert STUDIES[study](executor=executor) == STUDIES[study](workers=1)


@pytest.mark.parametrize(
    "workers", [0, 5000, "dask:/x:1", "dask://:8786", "two", 1.5, True, "dask://host:port"]
)
def test_workers_that_are_none_are_refused_in_a_sentence(workers: Any) -> None:
    with pytest.raises(
        ab.SpecError, match=r"workers must be .*whole number from 1 to 4096, or dask://HOST:PORT"
    ):
        ab.sweep(hop(), SPREAD, 1, workers=workers)


def test_a_worker_of_other_versions_refuses_to_work(monkeypatch: pytest.MonkeyPatch) -> None:
    shared = pickle.dumps(workers._Shared("a task"))
    assert pickle.loads(shared).task == "a task"
    workers._unpacked.cache_clear()
    monkeypatch.setattr(workers, "_versions", lambda: (("aerobat", "0.0"),))
    with pytest.raises(ab.SpecError, match=r"one has aerobat 0\.0, and not aerobat .*; install the same"):
        pickle.loads(shared)


@pytest.mark.process
def test_a_scheduler_that_is_not_there_is_said_not_to_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("aerobat.studies.workers._CONNECT_TIMEOUT", 0.2)
    with pytest.raises(ab.SpecError, match=r"no scheduler answers at dask://127\.0\.0\.1:9; start one"):
        ab.sweep(hop(), SPREAD, 1, workers="dask://127.0.0.1:9")


def test_without_dask_the_command_is_named_that_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(BackendMissing, match=r'pip install "aerobat\[cluster\]"'):
        ab.sweep(hop(), SPREAD, 1, workers="dask://127.0.0.1:9")


def test_what_parts_share_is_packed_once_for_all_of_them() -> None:
    packed: list[int] = []
    shared = workers._Shared(_Counted(packed))
    for _ in range(3):
        pickle.dumps(shared)
        assert shared.__dask_tokenize__() == shared.__reduce__()[1]
    assert len(packed) == 1


class _Counted:
    """A task that counts how often it is packed."""

    def __init__(self, packed: list[int]) -> None:
        self.packed = packed

    def __reduce__(self) -> tuple[Any, ...]:
        self.packed.append(1)
        return list, ()
