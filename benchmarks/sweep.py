"""Ten thousand flights under `lab`: the memory of all processes together, and the processor time of a flight.

The floor is 500 MB. Memory is counted once where processes share it (PSS, of /proc/*/smaps_rollup), and
beside it as often as it is shared (RSS). Linux only.

Usage: python benchmarks/sweep.py [runs] [workers]
"""

from __future__ import annotations

import os
import resource
import sys
import threading
from pathlib import Path

import aerobat as ab

PERIOD = 0.05  # [s] between looks at the memory


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    workers = int(sys.argv[2]) if len(sys.argv) > 2 else 2
    plan = ab.plan("half-flip", vehicle="agile-quad")
    began = processor_time()
    with Watch() as watch:
        swept = ab.sweep(plan, "lab", runs, 7, workers=workers)
        ab.sweep_figure(swept)
    spent = processor_time() - began
    print(swept)
    print(f"{workers} workers: {1000 * spent / runs:.2f} ms of the processor a flight, compilation included")
    print(f"at most {watch.shared:.0f} MB in {watch.processes} processes, {watch.resident:.0f} MB if what")
    print("they share is counted for each of them; the floor is 500 MB")


def processor_time() -> float:
    """Processor time [s] of this process and of those that it has waited for."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


class Watch:
    """The largest memory [MB] of this process and its children, while it lasts."""

    def __init__(self) -> None:
        self.shared = self.resident = 0.0
        self.processes = 0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)

    def __enter__(self) -> Watch:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._ended.set()
        self._thread.join()

    def _look(self) -> None:
        while not self._ended.wait(PERIOD):
            found = [memory(process) for process in family()]
            self.shared = max(self.shared, sum(pss for pss, _ in found))
            self.resident = max(self.resident, sum(rss for _, rss in found))
            self.processes = max(self.processes, len(found))


def family() -> list[int]:
    """This process and its children."""
    children = Path(f"/proc/{os.getpid()}/task").glob("*/children")
    return [os.getpid(), *(int(pid) for path in children for pid in path.read_text().split())]


def memory(process: int) -> tuple[float, float]:
    """PSS and RSS of a process [MB]; nothing of one that has ended."""
    try:
        lines = Path(f"/proc/{process}/smaps_rollup").read_text().splitlines()
    except (FileNotFoundError, ProcessLookupError):
        return 0.0, 0.0
    sizes = {line.split(":")[0]: int(line.split()[1]) / 1000 for line in lines[1:]}
    return sizes.get("Pss", 0.0), sizes.get("Rss", 0.0)


if __name__ == "__main__":
    main()
