"""How much of the processor a plan of each preset problem takes, its own two flights included.

The first plan of a fresh process, from `import aerobat` on, and a second one in the same process.

uv run python benchmarks/first_plan.py [RUNS]
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile

PROBLEMS = ("flip-roll", "flip-pitch", "flip-roll-translation", "half-flip", "line")
ONE_RUN = """
import json, sys, time
import aerobat as ab
from aerobat.planning.flyability import nominal_flight

vehicle, problem = ab.load_vehicle("agile-quad"), ab.load_problem(sys.argv[1])
seconds = []
for _ in range(2):
    nominal_flight.cache_clear()
    began = time.process_time()
    plan = ab.plan(problem, vehicle=vehicle)
    seconds.append(time.process_time() - began)
print(json.dumps([*seconds, plan.duration]))
"""


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 9
    print(f"seconds of the processor, medians of {runs} fresh processes")
    with tempfile.TemporaryDirectory() as bytecode:
        environment = os.environ | {"PYTHONPYCACHEPREFIX": bytecode, "PYTHONDONTWRITEBYTECODE": ""}
        for problem in PROBLEMS:
            measured = [run(problem, environment) for _ in range(runs + 1)][1:]
            first, second, duration = (statistics.median(column) for column in zip(*measured, strict=True))
            print(
                f"  {problem:24s} first {first:.3f}  second {second:.3f}  duration {duration:.4f} s",
                flush=True,
            )


def run(problem: str, environment: dict[str, str]) -> list[float]:
    """One process: the first plan, the second, and the plan's duration [s]."""
    command = [sys.executable, "-c", ONE_RUN, problem]
    done = subprocess.run(command, check=True, capture_output=True, env=environment)
    measured: list[float] = json.loads(done.stdout)
    return measured


if __name__ == "__main__":
    main()
