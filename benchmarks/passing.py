"""Plans that pass with a probability: what that costs in duration, and how long it takes to prove them.

    uv run python benchmarks/passing.py [--probability 0.95] [--maneuvers half-flip ...] [--vehicles ...]

Each maneuver is planned for each vehicle as `aerobat plan MANEUVER --vehicle VEHICLE --pass 0.95` does it. A
row tells how many fresh flights under `lab` pass by the plain plan and by the one that is proven, their
durations, and the time of the processor for all of it, on one core.
"""

import argparse
import os
import time

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")  # before NumPy starts its own

import numpy as np

import aerobat as ab
from aerobat.planning.result import FLYING_CLEARANCE, FLYING_RESERVE
from aerobat.studies.passing import Passing

VEHICLES = ("agile-quad", "agilicious", "crazyflie", "hexarotor", "section-v", "x500")
MANEUVERS = ("half-flip", "flip-roll", "flip-pitch")


def found(maneuver: str, vehicle: str, probability: float) -> Passing | str:
    """The plan that passes, or why there is none."""
    planner = ab.Miqp(reserve=FLYING_RESERVE, clearance=FLYING_CLEARANCE)
    try:
        return ab.plan_to_pass(maneuver, planner, vehicle, probability=probability, workers=1)
    except ab.Infeasible as refusal:
        return refusal.sentence


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--probability", type=float, default=0.95)
    parser.add_argument("--maneuvers", nargs="+", default=list(MANEUVERS))
    parser.add_argument("--vehicles", nargs="+", default=list(VEHICLES))
    asked = parser.parse_args()
    prices, times, refused = [], [], 0
    for maneuver in asked.maneuvers:
        for vehicle in asked.vehicles:
            began = time.process_time()
            passing = found(maneuver, vehicle, asked.probability)
            times.append(time.process_time() - began)
            if isinstance(passing, str):
                refused += 1
                print(f"{maneuver}, {vehicle}: refused in {times[-1]:.0f} s: {passing}", flush=True)
                continue
            prices.append(passing.price / passing.plain.duration)
            print(
                f"{maneuver}, {vehicle}: {passing.before} in {passing.plain.duration:.3f} s; {passing.after} "
                f"in {passing.plan.duration:.3f} s, {100 * prices[-1]:.1f} % longer, reserve "
                f"{passing.tube.reserve:.2f}, body rate {np.degrees(peak(passing.plan)):.0f} of "
                f"{np.degrees(peak(passing.plain)):.0f}°/s; {times[-1]:.0f} s",
                flush=True,
            )
    print(
        f"{len(prices)} proven to pass with {asked.probability:g}, {refused} not; "
        f"{100 * np.median(prices):.1f} % longer at the median, {100 * max(prices):.1f} % at most; "
        f"{np.median(times):.0f} s of the processor, {max(times):.0f} s at most"
    )


def peak(plan: ab.Plan) -> float:
    """The largest body rate of a plan [rad/s]."""
    return (plan.assessment.max_body_rate if plan.assessment else None) or np.nan


if __name__ == "__main__":
    main()
