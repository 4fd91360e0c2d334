"""How the built-in search grows with stages and gates: flips through gates in a row, crossing times free.

    uv run python benchmarks/growth_with_stages.py [--runs N] [--max-gates N] [--others SECONDS]

`examples/two-flips.toml`, four ordered stages a gate, and the same with one gate and with more, each gate
adding 20 intervals of 0.1 s, order 3; beside it the paper's flip in roll, N = 20, its gate at a fixed time.
Then the two flips, once, on fewer and on more intervals. With --others, Gurobi and SCIP on 16 of them, so
much time each.
"""

import argparse
import os
import statistics
import time
from dataclasses import replace
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # one thread for everyone, before NumPy starts its own

import numpy as np

from aerobat.errors import AerobatError
from aerobat.optimization import AssignmentProgram, solver
from aerobat.optimization.deadline import within_time
from aerobat.planning.miqp.miqp import formulate
from aerobat.planning.task import Task
from aerobat.problem import CustomManeuver, load_problem
from paper_programs import paper_program

EXAMPLE = Path(__file__).parents[1] / "examples" / "two-flips.toml"
APART = 5.0  # [m] from gate to gate, along x
PER_GATE = 4  # stages


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--runs", type=int, default=5, help="runs of each, in turn (5)")
    parser.add_argument("--max-gates", type=int, default=3, metavar="N", help="gates in a row, at most (3)")
    parser.add_argument("--others", type=float, metavar="SECONDS", help="time limit for Gurobi and SCIP")
    options = parser.parse_args()
    programs = {"paper's flip": paper_program("flip-roll")}
    programs |= {f"{n} free": flips(n, 20 * n, 2.0 * n) for n in range(1, options.max_gates + 1)}
    seconds: dict[str, list[float]] = {name: [] for name in programs}
    nodes: dict[str, int] = {}
    for _ in range(options.runs + 1):
        for name, program in programs.items():
            began = time.perf_counter()
            nodes[name] = solved(program)
            seconds[name].append(time.perf_counter() - began)
    medians = {name: statistics.median(times[1:]) for name, times in seconds.items()}  # after a warm-up
    one = medians["paper's flip"]
    print(f"{'gates':14}{'N':>5}{'stages':>8}{'QPs':>7}{'time':>12}{'ratio':>8}")
    for name, program in programs.items():
        n, stages = program.num_variables // 3, len(program.stages)
        took = medians[name]
        print(f"{name:14}{n:5}{stages:8}{nodes[name]:7}{1e3 * took:9.1f} ms{took / one:8.0f}")
    for intervals in (20, 40, 80):
        began = time.perf_counter()
        relaxations = solved(flips(2, intervals, 4.0))
        seconds_taken = time.perf_counter() - began
        print(f"two flips in 4 s on N = {intervals}: {relaxations} QPs, {seconds_taken:.2f} s")
    if options.others is not None:
        others(options.others)


def others(limit: float) -> None:
    short = flips(2, 16, 4.0)
    for name in ("builtin", "gurobi", "scip"):
        try:
            with within_time(limit):
                result = solver(name).solve(short)
        except AerobatError as error:
            print(f"{name}: {error}")
            continue
        print(f"two flips, N = 16, {name}: {result.status}, cost {result.cost:.9g}, {result.time:.3f} s")


def flips(gates: int, intervals: int, duration: float) -> AssignmentProgram:
    """So many flips, the first as the example's first, the last one leading to the example's goal, moved."""
    example = load_problem(EXAMPLE)
    if not isinstance(example.maneuver, CustomManeuver):
        raise SystemExit(f"{EXAMPLE.name} is not a list of stages")
    apart = np.array([APART, 0.0, 0.0])
    first = example.gates[0]
    passed = [replace(first, name=f"gate {i}", position=first.position + i * apart) for i in range(gates)]
    one = example.maneuver.stages[:PER_GATE]
    stages = (replace(stage, gate=stage.gate and gate.name) for gate in passed for stage in one)
    shift = (gates - 2) * apart
    goal = replace(example.goal, position=example.goal.position + shift)
    limits = replace(example.limits, upper=example.limits.upper + np.maximum(shift, 0.0))
    maneuver = replace(example.maneuver, stages=tuple(stages))
    problem = replace(example, goal=goal, gates=tuple(passed), limits=limits, maneuver=maneuver)
    return formulate(Task.of(problem), 3, intervals).program(duration / intervals)


def solved(program: AssignmentProgram) -> int:
    """QPs until the optimum is proven."""
    result = solver().solve(program)
    if result.status != "optimal":
        raise SystemExit(f"the built-in search answered {result.status}")
    return result.nodes


if __name__ == "__main__":
    main()
