"""The built-in search against Gurobi on the paper's three flips, N = 20, dt = 0.1 s.

    uv run python benchmarks/planning_vs_gurobi.py [--runs N] [--in-turn] [--scip]

The built-in solver's time is all of it, from a program to a checked answer, nothing kept from the run before:
elimination, search, Python, the check. Gurobi's is the Runtime that its optimizer reports for the same
condensed program (the states eliminated), without building the model and without the check. One thread each.
Each solver's runs come in a row, as in a search on dt, after a warm-up; with --in-turn they alternate, and
the built-in search finds the caches cold.
"""

import argparse
import os
import statistics
import time

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # one thread for everyone, before NumPy starts its own

from aerobat.optimization import AssignmentProgram, solver
from paper_programs import FLIPS, paper_program


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--runs", type=int, default=9, help="runs of each (9)")
    parser.add_argument("--in-turn", action="store_true", help="alternate the solvers")
    parser.add_argument(
        "--scip", action="store_true", help="SCIP too, once: about a quarter of a minute a flip"
    )
    options = parser.parse_args()
    ratios = []
    print(f"{'':24}{'cost':>14}{'builtin':>12}{'Gurobi':>12}{'ratio':>8}" + options.scip * f"{'SCIP':>12}")
    for name in FLIPS:
        program = paper_program(name)
        solvers = (builtin, gurobi)
        runs = range(options.runs + 1)  # the first is a warm-up
        if options.in_turn:
            times = list(zip(*([run(program) for run in solvers] for _ in runs), strict=True))
        else:
            times = [tuple(run(program) for _ in runs) for run in solvers]
        ours, theirs = (statistics.median(of[1:]) for of in times)
        ratios.append(theirs / ours)
        cost = solver().solve(program).cost / 0.1**6
        scip = f"{solver('scip').solve(program).time:10.2f} s" if options.scip else ""
        print(f"{name:24}{cost:14.4f}{1e3 * ours:9.2f} ms{1e3 * theirs:9.1f} ms{ratios[-1]:8.0f}{scip}")
    print(f"median ratio {statistics.median(ratios):.0f}; medians of {options.runs} runs; the floor asks 60")


def builtin(program: AssignmentProgram) -> float:
    began = time.perf_counter()
    result = solver().solve(program)
    seconds = time.perf_counter() - began
    if result.status != "optimal":
        raise SystemExit(f"the built-in search answered {result.status}")
    return seconds


def gurobi(program: AssignmentProgram) -> float:
    return solver("gurobi").solve(program).time


if __name__ == "__main__":
    main()
