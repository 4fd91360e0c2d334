"""How far off the gate's centre flights under `lab` pass, without and with the disturbance observer.

The floors: 95 % within 5 cm, more than 99 % through a gate 1.3 times the body's width, no crash.

Usage: python benchmarks/robustness.py [runs] [seed]
"""

from __future__ import annotations

import sys

import numpy as np

import aerobat as ab

VEHICLES = ("hexarotor", "agile-quad")
MANEUVERS = ("flip-roll", "flip-pitch", "flip-roll-translation", "half-flip")
FILTERS = (0.0, ab.Controller().disturbance_filter)  # [s] of the disturbance observer, 0 for none
WIDER = 1.3  # [-] the gate over the body
CRASHED = ("diverged", "state_not_finite", "hit_ground")


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 7
    print("| vehicle | maneuver | filter | 95 % within | 1.3 × body | attitude missed | lost |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for vehicle in VEHICLES:
        for maneuver in MANEUVERS:
            plan = ab.plan(maneuver, ab.Miqp(order=4, reserve=0.15), vehicle)
            for seconds in FILTERS:
                swept = ab.sweep(
                    plan, "lab", runs, seed=seed, controller=ab.Controller(disturbance_filter=seconds)
                )
                print(f"| {vehicle} | {maneuver} | {seconds} s | {told(swept)} |", flush=True)


def told(swept: ab.Sweep) -> str:
    """Error at the gate, shares of flights that pass a wider gate, miss its attitude, or are lost."""
    body = 2.0 * swept.vehicle.bounding_ellipsoid.semi_axes.max()
    passes = np.mean(swept.table["gate_needed_width_m"] <= WIDER * body)
    outcomes = swept.table["outcome"]
    tilted = np.mean(outcomes == "wrong_attitude")
    lost = np.mean(np.isin(outcomes, CRASHED))
    error = 100 * swept.quantile("gate_miss_m", 0.95)
    return f"{error:.1f} cm | {100 * passes:.1f} % | {100 * tilted:.1f} % | {100 * lost:.1f} %"


if __name__ == "__main__":
    main()
