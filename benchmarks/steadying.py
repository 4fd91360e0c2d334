"""Plans of which more flights succeed, where rotors' lag tells: how many more, and what that costs.

    uv run python benchmarks/steadying.py [--maneuvers flip-roll ...] [--vehicles crazyflie ...]

Each maneuver is planned for each vehicle as `aerobat fly` does it. A row tells the first plan and what is
taken in its place, the share of 400 other flights under `lab` that succeed, and the time of the processor
for either plan, on one core.
"""

import argparse
import os
import time
from dataclasses import replace
from math import radians

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")  # before NumPy starts its own

import aerobat as ab
from aerobat.planning.result import FLYING_CLEARANCE, FLYING_RESERVE
from aerobat.studies.passing import steadied

VEHICLES = ("agile-quad", "crazyflie", "agilicious", "hexarotor", "x500")
MANEUVERS = (  # with :tilt [deg]
    *("flip-roll", "flip-pitch", "half-flip", "half-flip:75", "half-flip:60", "half-flip:45", "half-flip:20"),
    *("power-loop", "split-s", "immelmann", "matty-flip", "inverted-pass"),
)
FLIGHTS = 400


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--maneuvers", nargs="+", default=list(MANEUVERS))
    parser.add_argument("--vehicles", nargs="+", default=list(VEHICLES))
    asked = parser.parse_args()
    planner, lab = ab.Miqp(reserve=FLYING_RESERVE, clearance=FLYING_CLEARANCE), ab.load_dispersion("lab")
    for vehicle in asked.vehicles:
        for maneuver in asked.maneuvers:
            times = [time.process_time()]
            try:
                first = ab.plan(problem_of(maneuver), planner, vehicle)
            except ab.Infeasible:
                print(f"{maneuver}, {vehicle}: no plan", flush=True)
                continue
            times.append(time.process_time())
            found = steadied(first, planner, lab)
            times.append(time.process_time())
            shares = f"{succeed(first):.1f} %" + ("" if found is first else f" → {succeed(found):.1f} %")
            print(
                f"{maneuver}, {vehicle}: {first.duration:.3f} → {found.duration:.3f} s, "
                f"{100 * (found.duration / first.duration - 1):+.1f} %; {shares} succeed; "
                f"{times[1] - times[0]:.1f} + {times[2] - times[1]:.1f} s",
                flush=True,
            )


def problem_of(maneuver: str) -> ab.Problem:
    """The problem of a name, which a tilt of its gate may follow after a colon."""
    name, _, tilt = maneuver.partition(":")
    problem = ab.load_problem(name)
    if not tilt:
        return problem
    return replace(problem, gates=problem.maneuver.with_gate_tilt(problem.gates, radians(float(tilt))))


def succeed(plan: ab.Plan) -> float:
    """The share of other flights that succeed [%]."""
    scores = ab.score_flights(plan, conditions="lab", flights=range(FLIGHTS))
    return 100 * float(scores.succeeded.mean())


if __name__ == "__main__":
    main()
