"""How long the main job takes against importing NumPy and Matplotlib, each in a fresh process, in turn.

uv run python benchmarks/first_result.py [RUNS]
"""

import statistics
import subprocess
import sys
import tempfile
import time

IMPORTS = [sys.executable, "-c", "import numpy, matplotlib.pyplot"]


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 7
    with tempfile.TemporaryDirectory() as folder:
        job = [sys.executable, "-m", "aerobat.cli", "fly", "flip-roll", "--out", folder]
        pairs = [(seconds(job), seconds(IMPORTS)) for _ in range(runs + 1)][1:]  # after a warm-up
    jobs, imports = zip(*pairs, strict=True)
    ratio = statistics.median(a / b for a, b in pairs)
    print(f"aerobat fly flip-roll           {statistics.median(jobs):.2f} s (median of {runs})")
    print(f"import numpy, matplotlib.pyplot {statistics.median(imports):.2f} s")
    print(f"ratio                           {ratio:.2f} (median of pairs; the floor asks at most 2.5)")


def seconds(command: list[str]) -> float:
    began = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - began


if __name__ == "__main__":
    main()
