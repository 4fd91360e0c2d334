"""Flights on a cluster: the same bits as in one process, and the processor time that sharing them takes.

Starts a Dask scheduler and three worker processes on this machine, and flies half-flip under `lab` in this
process, in three forks of it, in three processes that share no memory with it, and on the cluster, where one
worker is killed in mid-run the second time. The floor is an overhead of 5 % of the processor's time at 10^5
flights, of the cluster over as many processes of this machine: those share its cores and caches as the
workers do. Each kind flies a little first, so that imports and compilations are not counted; of several
rounds, the least time of each kind counts. What the idle cluster takes (its heartbeats) is measured first,
and taken off. Linux only: processor times are read from /proc.

Usage: python benchmarks/cluster.py [runs] [rounds]
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import distributed

import aerobat as ab

WORKERS = 3
IDLE = 10.0  # [s] of looking at the idle cluster
TICKS = os.sysconf("SC_CLK_TCK")


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    rounds = int(sys.argv[2]) if len(sys.argv) > 2 else 3
    plan = ab.plan("half-flip", vehicle="agile-quad")
    options = {"threads_per_worker": 1, "host": "127.0.0.1", "dashboard_address": None}
    apart = ProcessPoolExecutor(WORKERS, multiprocessing.get_context("spawn"))
    with apart, distributed.LocalCluster(n_workers=WORKERS, **options) as cluster:
        address = cluster.scheduler_address.replace("tcp://", "dask://")
        alike = f"{WORKERS} forks"
        kinds: dict[str, dict[str, Any]] = {
            "one process": {"workers": 1},
            alike: {"workers": WORKERS},
            f"{WORKERS} processes that share no memory": {"executor": apart},
            f"{WORKERS} Dask workers": {"workers": address},
        }
        for at_work in kinds.values():
            ab.sweep(plan, "lab", 4000, **at_work)
        began = processor_time()
        time.sleep(IDLE)
        idle = (processor_time() - began) / IDLE
        print(f"the idle cluster takes {100 * idle:.1f} % of a processor, which is taken off below")
        spent: dict[str, list[tuple[float, float]]] = {kind: [] for kind in kinds}
        for number in range(rounds):  # in turns: other work on this machine slows all of them down alike
            found = []
            for kind, at_work in kinds.items():
                swept, took = timed(plan, runs, number, idle, **at_work)
                spent[kind].append(took)
                found.append(swept)
            assert all(swept == found[0] for swept in found), "other bits"
        for kind, took in spent.items():
            report(kind, runs, took, spent[alike])
        with killing(next(iter(cluster.workers.values())).pid) as progress:
            swept, took = timed(plan, runs, number, idle, workers=address, progress=progress)
        report("and one of them killed", runs, [took], spent[alike])
        assert swept == found[0], "other bits"
    print("the same bits in all of them")


def timed(
    plan: ab.Plan, runs: int, seed: int, idle: float, **at_work: Any
) -> tuple[ab.Sweep, tuple[float, float]]:
    """A sweep, and what it took of the clock and of the processors [s], without that of an idle cluster."""
    began, spent = time.perf_counter(), processor_time()
    swept = ab.sweep(plan, "lab", runs, seed, **at_work)
    took = time.perf_counter() - began
    return swept, (took, processor_time() - spent - idle * took)


def report(kind: str, runs: int, spent: list[tuple[float, float]], alike: list[tuple[float, float]]) -> None:
    clock, processor, least = (
        min(took[k] for took in each) for each, k in ((spent, 0), (spent, 1), (alike, 1))
    )
    print(
        f"{kind}: {clock:.1f} s, {1000 * processor / runs:.3f} ms of the processor a flight, "
        f"{100 * (processor / least - 1):+.1f} %",
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
