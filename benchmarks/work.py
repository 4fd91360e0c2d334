"""Work that solvers count, over the processor's time: work limits stand for about as many seconds.

    uv run python benchmarks/work.py [--count N] [--seed S] [--planners miqp ...]

Random problems are planned, after one that is not measured. A row is a planner: the time at the median, and
the 5th, 50th and 95th percentile of the ratio. The constants of work are right where the median is one.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")  # before NumPy starts its own

import argparse
from collections.abc import Iterator
from contextlib import suppress
from time import thread_time

import numpy as np

from aerobat.errors import Infeasible
from aerobat.optimization.deadline import work
from aerobat.planning import plan
from random_problems import random_case


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=20, help="problems (20)")
    parser.add_argument("--seed", type=int, default=0, help="their seed (0)")
    parser.add_argument("--planners", nargs="*", default=["miqp", "free-knots", "time-optimal"])
    options = parser.parse_args()
    print(f"{'planner':14}{'time, median [s]':>18}{'work over time: 5 %':>22}{'50 %':>8}{'95 %':>8}")
    for planner in options.planners:
        pairs = np.array(list(measured(planner, options.seed, options.count)))
        low, middle, high = np.percentile(pairs[:, 0] / pairs[:, 1], [5, 50, 95])
        print(f"{planner:14}{np.median(pairs[:, 1]):18.2f}{low:22.2f}{middle:8.2f}{high:8.2f}", flush=True)


def measured(planner: str, seed: int, count: int) -> Iterator[tuple[float, float]]:
    """Yield the work and the processor's time of each problem [s]."""
    for number, k in enumerate((0, *range(count))):
        case = random_case(seed, k, ())
        before = work(), thread_time()
        with suppress(Infeasible):
            plan(case.problem, planner, case.vehicle)
        after = work(), thread_time()
        if number:  # the first plan compiles
            yield after[0] - before[0], after[1] - before[1]


if __name__ == "__main__":
    main()
