"""How long the main job takes against importing NumPy and Matplotlib, each in a fresh process, in turn.

With compiled bytecode, as from the second run on, and without any, as on the very first.

uv run python benchmarks/first_result.py [RUNS]
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

IMPORTS = [sys.executable, "-c", "import numpy, matplotlib.pyplot"]


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 7
    with tempfile.TemporaryDirectory() as folder:
        job = [sys.executable, "-m", "aerobat", "fly", "flip-roll", "--out", str(Path(folder) / "out")]
        bytecode = {"PYTHONPYCACHEPREFIX": str(Path(folder) / "bytecode")}
        report("compiled bytecode", job, runs, {**bytecode, "PYTHONDONTWRITEBYTECODE": ""})
        report("no bytecode", job, runs, {"PYTHONPYCACHEPREFIX": folder, "PYTHONDONTWRITEBYTECODE": "1"})


def report(label: str, job: list[str], runs: int, variables: dict[str, str]) -> None:
    environment = {**os.environ, **variables}
    pairs = [(seconds(job, environment), seconds(IMPORTS, environment)) for _ in range(runs + 1)][1:]
    jobs, imports = zip(*pairs, strict=True)
    ratio = statistics.median(a / b for a, b in pairs)
    print(f"{label}, median of {runs} after a warm-up")
    print(f"  aerobat fly flip-roll           {statistics.median(jobs):.2f} s")
    print(f"  import numpy, matplotlib.pyplot {statistics.median(imports):.2f} s")
    print(f"  ratio                           {ratio:.2f} (median of pairs; the floor asks at most 2.5)")


def seconds(command: list[str], environment: dict[str, str]) -> float:
    began = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=environment)
    return time.perf_counter() - began


if __name__ == "__main__":
    main()
