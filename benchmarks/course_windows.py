"""Stages of courses placed in windows that move along, beside one short search of the whole.

    uv run python benchmarks/course_windows.py

One program each, at one dt: `race-7` (seven waypoints) and flips through gates in a row, four stages a gate,
as in growth_with_stages.py. "whole" is the built-in search, ended after 500 QPs; windows begin with what it
found. Where the optimum is known (three gates, proven by growth_with_stages.py) the last column is how much
dearer the windows' answer is. Times are of the processor, on one core.
"""

import os
import time

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # one thread, before NumPy starts its own

from aerobat.optimization import AssignmentProgram, improved_in_windows, solver
from aerobat.planning.miqp.miqp import formulate
from aerobat.planning.task import Task
from aerobat.problem import load_problem
from growth_with_stages import flips

WHOLE = 500  # QPs
THREE_FLIPS = 0.086657770820432  # the proven optimum


def main() -> None:
    race = load_problem("race-7")
    cases: dict[str, tuple[AssignmentProgram, float | None]] = {
        "race-7, N = 42": (formulate(Task.of(race), 4, 42).program(9.0 / 42), None),
        "race-7, N = 70": (formulate(Task.of(race), 4, 70).program(9.0 / 70), None),
        "three flips, N = 60": (flips(3, 60, 6.0), THREE_FLIPS),
        "five flips, N = 100": (flips(5, 100, 10.0), None),
    }
    print(
        f"{'':22}{'whole':>10}{'bound':>10}{'windows':>10}{'ratio':>8}{'QPs':>7}{'time':>9}"
        "  above the optimum"
    )
    for name, (program, optimum) in cases.items():
        whole = solver().solve(program, node_limit=WHOLE)
        began = time.process_time()
        placed = improved_in_windows(program, whole)
        spent = time.process_time() - began
        above = "" if optimum is None else f"{100 * (placed.cost / optimum - 1):.2g} %"
        print(
            f"{name:22}{whole.cost:10.4g}{whole.bound:10.3g}{placed.cost:10.4g}"
            f"{whole.cost / placed.cost:8.2f}"
            f"{placed.nodes - whole.nodes:7}{spent:7.2f} s  {above}"
        )


if __name__ == "__main__":
    main()
