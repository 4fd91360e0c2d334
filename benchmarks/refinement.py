"""How fast refined plans are beside what no motion falls short of, and what they cost.

uv run python benchmarks/refinement.py [--reserve 0.1]

Every maneuver that comes along, on three vehicles: `miqp` and `free-knots`, their durations over the proven
lower bound, and seconds of the processor. Medians at the end.
"""

from __future__ import annotations

import argparse
from statistics import median
from time import process_time

import aerobat as ab
from aerobat.planning import least_duration

VEHICLES = ("agile-quad", "crazyflie", "section-v")


def main() -> None:
    """Print a line a plan, then medians."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--reserve", type=float, default=0.0)
    reserve = parser.parse_args().reserve
    rows: dict[str, list[tuple[float, float]]] = {}
    for name in ab.problem_names():
        problem = ab.load_problem(name)
        if not problem.ends:
            continue
        for vehicle in map(ab.load_vehicle, VEHICLES):
            for planner in (ab.Miqp(reserve=reserve, rescue=False), ab.FreeKnots(reserve=reserve)):
                began = process_time()
                try:
                    plan = ab.plan(problem, planner, vehicle)
                except ab.Infeasible as refusal:
                    print(f"{name:24}{vehicle.name:12}{planner.kind:12}{str(refusal)[:60]}", flush=True)
                    continue
                seconds = process_time() - began
                ratio = plan.duration / least_duration(problem, vehicle)
                rows.setdefault(planner.kind, []).append((ratio, seconds))
                told = f"{plan.duration:8.3f} s  {ratio:6.3f}  {seconds:6.2f} s"
                flies = "" if plan.flies else "  does not fly"
                print(f"{name:24}{vehicle.name:12}{planner.kind:12}{told}{flies}", flush=True)
    for kind, found in rows.items():
        ratios, times = zip(*found, strict=True)
        print(
            f"{kind}: {median(ratios):.3f} times the lower bound, {median(times):.2f} s, {len(found)} plans"
        )


if __name__ == "__main__":
    main()
