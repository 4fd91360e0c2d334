"""Flights on a cluster: the same bits as in one process, and the processor time that sharing them takes.

Starts a Dask scheduler and three worker processes on this machine, and flies half-flip under `lab` in this
process, in two processes, and on the cluster, where one worker is killed in mid-run the second time. The
floor is an overhead of 5 % of the processor's time at 10^5 flights; each kind flies a little first, so that
imports and compilations are not counted. Linux only: processor times are read from /proc.

Usage: python benchmarks/cluster.py [runs]
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import distributed

import aerobat as ab

WORKERS = 3
SEED = 7
TICKS = os.sysconf("SC_CLK_TCK")


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    plan = ab.plan("half-flip", vehicle="agile-quad")
    options = {"threads_per_worker": 1, "host": "127.0.0.1", "dashboard_address": None}
    with distributed.LocalCluster(n_workers=WORKERS, **options) as cluster:
        address = cluster.scheduler_address.replace("tcp://", "dask://")
        whole, alone = timed(plan, runs, workers=1)
        report("one process", runs, alone, alone)
        for name, at_work in (("two processes", 2), (f"{WORKERS} Dask workers", address)):
            ab.sweep(plan, "lab", 1000, workers=at_work)
            swept, spent = timed(plan, runs, workers=at_work)
            report(name, runs, spent, alone)
            assert swept == whole, "other bits"
        with killing(next(iter(cluster.workers.values())).pid) as progress:
            swept, spent = timed(plan, runs, workers=address, progress=progress)
        report("and one of them killed", runs, spent, alone)
        assert swept == whole, "other bits"
    print("the same bits in all of them")


def timed(plan: ab.Plan, runs: int, **at_work: Any) -> tuple[ab.Sweep, tuple[float, float]]:
    """A sweep, and what it took of the clock and of the processors [s]."""
    began, spent = time.perf_counter(), processor_time()
    swept = ab.sweep(plan, "lab", runs, SEED, **at_work)
    return swept, (time.perf_counter() - began, processor_time() - spent)


def report(name: str, runs: int, spent: tuple[float, float], alone: tuple[float, float]) -> None:
    clock, processor = spent
    print(
        f"{name}: {clock:.1f} s, {1000 * processor / runs:.3f} ms of the processor a flight, "
        f"{100 * (processor / alone[1] - 1):+.1f} %",
        flush=True,
    )


def processor_time() -> float:
    """Processor time [s] of this process and of all that it has begun, the ended ones among them."""
    return sum(map(_used, family(os.getpid())))


def family(process: int) -> Iterator[int]:
    """A process and all that descend from it."""
    yield process
    for children in Path(f"/proc/{process}/task").glob("*/children"):
        for child in children.read_text().split():
            yield from family(int(child))


def _used(process: int) -> float:
    """Processor time [s] of a process, and of its children that have ended."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except FileNotFoundError:
        return 0.0
    return sum(map(int, fields[11:15])) / TICKS


@contextmanager
def killing(process: int) -> Iterator[Callable[[int, int], None]]:
    """What is called with the flights done, and kills a process at the first of them."""
    left = [process]

    def progress(done: int, well: int) -> None:
        if left:
            os.kill(left.pop(), signal.SIGKILL)

    yield progress


if __name__ == "__main__":
    main()
