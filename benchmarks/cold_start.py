"""A first flight in a fresh process, against importing what it needs, in turn.

One flip of 3.4 s at 1 kHz with its full log, along a trajectory saved beforehand; it is compiled anew, for
nothing is cached. Wall-clock seconds; medians of RUNS.

uv run python benchmarks/cold_start.py [RUNS]
"""

import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import aerobat as ab

VEHICLE, FLIP = "crazyflie", "flip-roll"  # 3.4 s from rest to rest
RATE = 1000.0  # [1/s]
IMPORTS = "import numpy, llvmlite.binding"
FLIGHT = """
import aerobat as ab
vehicle = ab.load_vehicle({vehicle!r})
flight = ab.fly(ab.load_trajectory({path!r}), vehicle, rate={rate!r}, engine="compiled")
assert len(flight.times) > {rows} and flight.outcome.name == "COMPLETE"
"""
FLOOR = (2.0, 0.4)  # times the imports, and seconds more


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 11
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plan.npz"
        trajectory = ab.plan(ab.load_problem(FLIP), ab.Miqp(), ab.load_vehicle(VEHICLE)).trajectory
        ab.save_trajectory(trajectory, path)
        code = FLIGHT.format(path=str(path), vehicle=VEHICLE, rate=RATE, rows=int(RATE * trajectory.duration))
        pairs = [(seconds(code), seconds(IMPORTS)) for _ in range(runs + 1)][1:]  # after a warm-up
    flights, imports = zip(*pairs, strict=True)
    typical, first, length = statistics.median(imports), statistics.median(flights), trajectory.duration
    print(f"import numpy, llvmlite.binding              {typical:.2f} s (median of {runs})")
    print(f"import aerobat, compile, fly {length:.1f} s at 1 kHz {first:.2f} s")
    print(
        f"floor: {FLOOR[0]:g} × the imports + {FLOOR[1]:g} s           {FLOOR[0] * typical + FLOOR[1]:.2f} s"
    )


def seconds(code: str) -> float:
    began = time.perf_counter()
    subprocess.run([sys.executable, "-c", code], check=True)
    return time.perf_counter() - began


if __name__ == "__main__":
    main()
