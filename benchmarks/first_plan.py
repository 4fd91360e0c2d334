"""How much of the processor a plan of each preset problem takes, its own two flights included.

The first plan of a fresh process after `import aerobat`, apart from the import of what it needs beyond that,
and a second one in the same process.

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

vehicle, problem = ab.load_vehicle("agile-quad"), ab.load_problem(sys.argv[1])
began = time.process_time()
import aerobat.planning.miqp.miqp
from aerobat.planning.flyability import nominal_flight

seconds = [time.process_time() - began]
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
            columns = (statistics.median(column) for column in zip(*measured, strict=True))
            modules, first, second, duration = columns
            print(
                f"  {problem:24s} modules {modules:.3f}  first {first:.3f}  second {second:.3f}  "
                f"duration {duration:.4f} s",
                flush=True,
            )


def run(problem: str, environment: dict[str, str]) -> list[float]:
    """One process: the import of modules, the first plan, the second, and the plan's duration [s]."""
    command = [sys.executable, "-c", ONE_RUN, problem]
    done = subprocess.run(command, check=True, capture_output=True, env=environment)
    measured: list[float] = json.loads(done.stdout)
    return measured


if __name__ == "__main__":
    main()
