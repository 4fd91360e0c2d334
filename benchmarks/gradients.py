"""The gradient of a flip's mean squared position error in five gains, against differences and against JAX.

    uv run python benchmarks/gradients.py [RUNS]

The flip "flip-roll" of agile-quad at 500 Hz; medians of RUNS (9) whole calls after a first one that
compiles, from arguments to answer: set-points, packing, simulation. Differences are central ones of
`score_flights` with the same engine, ten flights. JAX runs the same dual numbers by its own compiler.
"""

import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import replace

import aerobat as ab

FIVE = ("position_gain", "velocity_gain", "integral_gain", "attitude_frequency", "attitude_damping")
STEP = 1e-4  # of a gain
FLOOR = 0.050  # [s]


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 9
    vehicle, problem = ab.load_vehicle("agile-quad"), ab.load_problem("flip-roll")
    flip = ab.plan(problem, ab.Miqp(), vehicle).trajectory

    def exact(engine: str) -> list[float]:
        answer = ab.sensitivity(flip, FIVE, vehicle, engine=engine).mean_square_position_error
        return [float(answer.slopes[name]) for name in FIVE]

    def differences() -> list[float]:
        return [difference(lambda c: square(flip, vehicle, problem, c), name) for name in FIVE]

    ways = {
        "compiled": lambda: exact("compiled"),
        "differences": differences,
        "jax": lambda: exact("jax"),
    }
    wanted = exact("floats")
    print(f"{'':14}{'first call':>12}{'median':>12}   largest relative difference from floats")
    for name, way in ways.items():
        seconds = [timed(way)[0] for _ in range(runs + 1)]
        worst = max(abs(a / b - 1.0) for a, b in zip(way(), wanted, strict=True))
        middle = statistics.median(seconds[1:])
        print(f"{name:14}{seconds[0]:10.2f} s{1e3 * middle:9.1f} ms   {worst:.1e}")
        if name == "compiled":
            print(f"{'':14}the floor asks {1e3 * FLOOR:.0f} ms: {'met' if middle < FLOOR else 'missed'}")


def timed(way: Callable[[], list[float]]) -> tuple[float, list[float]]:
    began = time.perf_counter()
    answer = way()
    return time.perf_counter() - began, answer


def square(path: ab.Trajectory, vehicle: ab.Vehicle, problem: ab.Problem, controller: ab.Controller) -> float:
    scores = ab.score_flights(path, vehicle, problem=problem, controller=controller, engine="compiled")
    return float(scores.rms_position_error_m[0]) ** 2


def difference(error: Callable[[ab.Controller], float], name: str) -> float:
    usual = ab.Controller()
    value = getattr(usual, name)
    above, below = (error(replace(usual, **{name: value * (1.0 + h)})) for h in (STEP, -STEP))
    return (above - below) / (2.0 * STEP * value)


if __name__ == "__main__":
    main()
