"""Flights of a lab by the tracking controller, with its own gains and with others near them.

    uv run python benchmarks/default_gains.py [--flights 100] [--conditions lab]

Plans of six maneuvers on five vehicles, each as its planner finds it, neither steadied nor tightened; the
same flights by every set of gains. Prints the share that succeeds a vehicle, of all maneuvers together, and
how far off the path those flights are at most, at the median.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

import aerobat as ab

VEHICLES = ("agile-quad", "agilicious", "hexarotor", "crazyflie", "x500")
MANEUVERS = ("line", "half-flip", "flip-roll", "split-s", "power-loop", "barrel-roll")
FIRST = 700_000  # number of a flight: plans are chosen by others
SETS: tuple[dict[str, float], ...] = (
    {},
    {"attitude_damping": 0.85, "lead_time_constant": 0.01},  # as they were
    {"attitude_damping": 1.1, "lead_time_constant": 0.01},
    {"attitude_damping": 0.9},
    {"attitude_damping": 1.3},
    {"attitude_frequency": 20.0},
    {"attitude_frequency": 30.0},
    {"position_gain": 20.0, "velocity_gain": 8.0},
    {"position_gain": 30.0, "velocity_gain": 10.0},
)


def main() -> None:
    """Plan, fly, and print a row a set of gains."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--flights", type=int, default=100)
    parser.add_argument("--conditions", default="lab")
    asked = parser.parse_args()
    plans = {name: [plan for maneuver in MANEUVERS if (plan := planned(maneuver, name))] for name in VEHICLES}
    print("| gains | " + " | ".join(VEHICLES) + " | mean |")
    print("| --- |" + " --- |" * (len(VEHICLES) + 1))
    for gains in SETS:
        cells, shares = [], []
        for name in VEHICLES:
            vehicle = ab.load_vehicle(name)
            vehicle = replace(vehicle, controller=replace(vehicle.controller, **gains))
            flights = range(FIRST, FIRST + asked.flights)
            scores = [
                ab.score_flights(plan, vehicle, conditions=asked.conditions, flights=flights)
                for plan in plans[name]
            ]
            shares.append(np.mean([each.succeeded.mean() for each in scores]))
            off = np.median([np.median(each.max_position_error_m) for each in scores])
            cells.append(f"{100.0 * shares[-1]:.1f} %, {100.0 * off:.1f} cm")
        words = ", ".join(f"`{key}` {value:g}" for key, value in gains.items()) or "the defaults"
        print(f"| {words} | " + " | ".join(cells) + f" | {100.0 * np.mean(shares):.1f} % |", flush=True)


def planned(maneuver: str, vehicle: str) -> ab.Plan | None:
    """The plan of a maneuver for a vehicle; None where there is none."""
    try:
        return ab.plan(maneuver, vehicle=ab.load_vehicle(vehicle))
    except ab.Infeasible:
        return None


if __name__ == "__main__":
    main()
