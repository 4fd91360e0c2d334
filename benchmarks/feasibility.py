"""A map of the half-flip, angle by speed, beside single plans of some of its cells, and what it needs.

    uv run python benchmarks/feasibility.py [--workers 2] [--vehicle agile-quad] [--max-velocity 10]

The floor is a map of 10 x 10 cells in 60 s on two cores. Times of the clock are of the whole map, its
processes started; processor time is that of all of them together.
"""

import argparse
import os
import resource
import time
from dataclasses import replace
from math import radians

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # one thread for every process, before NumPy starts its own

import aerobat as ab
from aerobat.problem import Limits

ANGLES = range(0, 91, 10)  # [deg]
SPEEDS = range(2, 21, 2)  # [m/s]
BESIDE = 9  # every so many cells one is planned by itself


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--workers", type=int, default=2, help="processes (2)")
    parser.add_argument("--vehicle", default="agile-quad", help="a preset's name (agile-quad)")
    parser.add_argument("--max-velocity", type=float, default=10.0, help="[m/s] per axis (10)")
    arguments = parser.parse_args()
    problem = replace(ab.load_problem("half-flip"), limits=Limits(velocity=arguments.max_velocity))
    ab.plan(problem, vehicle=arguments.vehicle)  # imports what all processes share
    began, spent = time.perf_counter(), processor_time()
    over = {"angle": ANGLES, "speed": SPEEDS}
    found = ab.feasibility_map(problem, over, arguments.vehicle, workers=arguments.workers)
    print(f"{found}; {time.perf_counter() - began:.1f} s on {arguments.workers} cores, ", end="")
    print(f"{processor_time() - spent:.1f} s of the processor")
    beside = found.cells[::BESIDE]
    differing = [
        cell.values for cell in beside if alone(problem, arguments.vehicle, *cell.values) != cell.duration
    ]
    print(f"planned alone: {len(beside)} cells, {len(differing)} differ {differing or ''}")
    began = time.perf_counter()
    for need in ab.min_requirements(problem, arguments.vehicle, workers=arguments.workers):
        print(need)
    print(f"needs: {time.perf_counter() - began:.1f} s on {arguments.workers} cores")


def alone(problem: ab.Problem, vehicle: str, angle: float, speed: float) -> float | None:
    """The duration [s] of a cell's plan, made by itself; None where there is none.

    Args:
        problem: Whose gate is tilted and passed faster.
        vehicle: Its name.
        angle: [deg]
        speed: [m/s]
    """
    gates = (problem.gates[0].tilted(radians(angle)),)
    maneuver = ab.HalfFlip(passage=ab.GatePassage(speed=float(speed)))
    try:
        return ab.plan(replace(problem, gates=gates, maneuver=maneuver), vehicle=vehicle).duration
    except ab.Infeasible:
        return None


def processor_time() -> float:
    """Processor time [s] of this process and of those that it has waited for."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


if __name__ == "__main__":
    main()
