"""How the built-in search grows with the number of intervals: the flip in roll, always in 2 s.

    uv run python benchmarks/growth_with_horizon.py [--runs N] [--others SECONDS]

The first solve of a series eliminates and factorises, the next ones, as in a search on dt, only search. With
--others, Gurobi (whose free licence ends at N = 20) and SCIP stand beside, each with so much time a program.
"""

import argparse
import os
import statistics
import time

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # one thread for everyone, before NumPy starts its own

import numpy as np

from aerobat.errors import AerobatError
from aerobat.optimization import AssignmentProgram, solver
from aerobat.optimization.deadline import within_time
from paper_programs import paper_program

INTERVALS = (20, 40, 80, 160)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--runs", type=int, default=5, help="runs of each (5)")
    parser.add_argument("--others", type=float, metavar="SECONDS", help="time limit for Gurobi and SCIP")
    options = parser.parse_args()
    print(f"{'N':>4}{'QPs':>6}{'first':>12}{'next':>12}")
    times = []
    for intervals in INTERVALS:
        program = paper_program("flip-roll", intervals)
        nodes, first, following = builtin(program, options.runs)
        times.append((first, following))
        line = f"{intervals:4}{nodes:6}{1e3 * first:9.1f} ms{1e3 * following:9.1f} ms"
        if options.others is not None:
            line += "".join(f"   {other(name, program, options.others)}" for name in ("gurobi", "scip"))
        print(line, flush=True)
    first, following = (np.polyfit(np.log(INTERVALS), np.log(column), 1)[0] for column in np.transpose(times))
    print(f"time ~ N^{first:.2f} the first time, N^{following:.2f} after; medians of {options.runs} runs")


def builtin(program: AssignmentProgram, runs: int) -> tuple[int, float, float]:
    firsts, nexts, nodes = [], [], 0
    for _ in range(runs):
        series = solver()
        for seconds in (firsts, nexts):
            began = time.perf_counter()
            nodes = series.solve(program).nodes
            seconds.append(time.perf_counter() - began)
    return nodes, statistics.median(firsts), statistics.median(nexts)


def other(name: str, program: AssignmentProgram, limit: float) -> str:
    try:
        with within_time(limit):
            result = solver(name).solve(program)
    except AerobatError:
        return f"{name}: beyond the licence"
    return f"{name}: {result.time:.2f} s, {result.status}"


if __name__ == "__main__":
    main()
