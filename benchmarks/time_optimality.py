"""How far from the least time: free knots on the paper's Section V-D example and on flips.

    uv run python benchmarks/time_optimality.py [--runs N] [--starts N] [--sets ABDE]

Durations over those of the collocated rigid body in the plane for the sets, of the time-optimal planner for
flips, and over anchors by multiple shooting with RK4 in the plane; planning times are medians. Random starts
are closed forms with knots at random times.
"""

import argparse
import os
import statistics
import time
from dataclasses import replace

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # one thread for everyone, before NumPy starts its own

import numpy as np

from aerobat.errors import Infeasible
from aerobat.planning import MinSnap, Miqp, Plan, Planner, TimeOptimal, TimeScaling, plan
from aerobat.planning.polynomial.free_knots import FreeKnots
from aerobat.problem import Waypoint, Waypoints, load_problem
from aerobat.vehicle import Vehicle, load_vehicle
from collocation.planner import Collocation

# rotors up to [N], inertia [kg·m²], anchor [s]
SETS = {
    "A": (18.0, 0.12, 1.842),
    "B": (6.5, 0.12, 2.342),
    "D": (18.0, 0.012, 1.134),
    "E": (6.5, 0.012, 1.942),
}
SECTION_V = load_problem("section-v")
FLIPS = ("flip-roll", "half-flip")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--runs", type=int, default=3, help="runs of each (3)")
    parser.add_argument("--starts", type=int, default=20, help="random starts of each set (20)")
    parser.add_argument("--sets", default="ABDE", help="vehicles to take (ABDE)")
    options = parser.parse_args()
    heads = ("set", "segments", "duration", "ratio", "to anchor", "time")
    widths = (10, 10, 11, 8, 11, 9)
    print(
        "".join(f"{head:>{width}}" for head, width in zip(heads, widths, strict=True)), " certified  margin"
    )
    for name in options.sets:
        compare_section_v(name, options.runs)
    for name in options.sets:
        print(random_starts(name, options.starts), flush=True)
    for name in FLIPS:
        compare_flip(name)


def compare_section_v(name: str, runs: int) -> None:
    vehicle, anchor = section_v_vehicle(name), SETS[name][2]
    optimal = attempted(Collocation(planar=True), vehicle)  # as the anchors, which know the plane alone
    for segments in (2, 8):
        seconds = []
        for _ in range(runs):
            began = time.perf_counter()
            found = FreeKnots(segments).plan(SECTION_V, vehicle)
            seconds.append(time.perf_counter() - began)
        print(
            f"{name:>10}{segments:10}{found.duration:9.3f} s{over(found, optimal):>8}"
            f"{found.duration / anchor:11.3f}{statistics.median(seconds):7.2f} s  {certified(found)!s:9}"
            f"{found.certificate.margin:8.4f} N",
            flush=True,
        )


def attempted(planner: Planner, vehicle: Vehicle) -> Plan | None:
    try:
        return planner.plan(SECTION_V, vehicle)
    except Infeasible:
        return None


def random_starts(name: str, count: int) -> str:
    vehicle, rng = section_v_vehicle(name), np.random.default_rng(0)
    plans = [
        FreeKnots(start=random_start(vehicle, rng.uniform(0.2, 3.0, 2))).plan(SECTION_V, vehicle)
        for _ in range(count)
    ]
    ratios = sorted(found.duration / SETS[name][2] for found in plans)
    return (
        f"{name:>10}: {sum(map(certified, plans))} of {count} random starts end certified, to anchor "
        f"{ratios[0]:.3f} to {ratios[-1]:.3f}, median {statistics.median(ratios):.3f}"
    )


def random_start(vehicle: Vehicle, legs: np.ndarray) -> Plan:
    """The closed form with its knots at these times, whether the vehicle can fly it or not."""
    at, end = np.cumsum(legs).tolist()
    waypoint = Waypoint(position=np.array([np.nan, np.nan, -2.0]), time=at)
    problem = replace(SECTION_V, maneuver=Waypoints((waypoint,), duration=end))
    return MinSnap(time_scaling=TimeScaling.ALL, stop_after=1).plan(problem, vehicle)


def compare_flip(name: str) -> None:
    problem, vehicle = load_problem(name), load_vehicle("agile-quad")
    optimal = plan(problem, TimeOptimal(), vehicle)
    print(f"{name} on {vehicle.name}, time-optimal {optimal.duration:.3f} s")
    for label, planner in (("miqp", Miqp()), ("2 segments", FreeKnots(2)), ("8 segments", FreeKnots(8))):
        began = time.perf_counter()
        found = plan(problem, planner, vehicle)
        spent = time.perf_counter() - began
        print(
            f"{label:>20}{found.duration:9.3f} s{over(found, optimal):>8}{spent:18.2f} s  {certified(found)}",
            flush=True,
        )


def section_v_vehicle(name: str) -> Vehicle:
    most, inertia, _ = SETS[name]
    base = load_vehicle("section-v")
    rotors = tuple(replace(rotor, min_thrust=0.0, max_thrust=most) for rotor in base.rotors)
    return replace(base, inertia=inertia * np.eye(3), rotors=rotors)


def over(found: Plan, optimal: Plan | None) -> str:
    return "-" if optimal is None else f"{found.duration / optimal.duration:.3f}"


def certified(found: Plan) -> bool:
    return found.certificate is not None and found.certificate.certified


if __name__ == "__main__":
    main()
