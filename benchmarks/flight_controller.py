"""Flights on Betaflight's own firmware, beside the same flights with the model of its inner loop.

Plans pass by the model with 95 %, proven on other flights: those of `aerobat plan --pass 0.95 --autopilot
betaflight`. Prints, by maneuver and vehicle, how many flights of a lab pass, their largest distances from the
path, and how far the model's prediction of each is off, of the whole flight and of its second half, which the
offset of the start no longer tells; then the floors of all flights together. Needs the firmware, gcc and
Linux: `uv sync --dev --group betaflight`.
Arguments: flights of each maneuver (20), then names or files of vehicles (agile-quad and the 5-inch quadrotor
of examples/vehicles).
"""

from __future__ import annotations

import sys
import time

import numpy as np

import aerobat as ab

MANEUVERS = ("half-flip", "flip-roll", "flip-pitch", "power-loop", "split-s")
CONDITIONS = "lab"
FIRST = 100_000  # number of a flight: the plan was tightened and proven on others
PLANNER = ab.Miqp(reserve=0.15)
SHARE, MEDIAN, MOST = 0.95, 0.05, 0.20  # [-], [m], [m] the floors


def main(flights: int, vehicles: list[str]) -> None:
    """Fly all, and print."""
    began = time.perf_counter()
    passed, distances, differences, late_differences = [], [], [], []
    for vehicle in map(ab.load_vehicle, vehicles):
        for maneuver in MANEUVERS:
            plan = planned(maneuver, vehicle)
            ended, real, model, late_real, late_model = [], [], [], [], []
            for flight in range(flights):
                drawn = {
                    "conditions": CONDITIONS,
                    "flights": range(FIRST + flight, FIRST + flight + 1),
                    "controller": "rates",
                }
                flown = ab.fly(plan, autopilot="betaflight", **drawn)[0]
                predicted = ab.fly(plan, **drawn)[0]
                ended.append(ab.score(flown, plan, vehicle).outcome.is_success)
                for each, whole, late in ((flown, real, late_real), (predicted, model, late_model)):
                    whole.append(each.position_error.max())
                    late.append(each.position_error[each.times > 0.5 * plan.duration].max(initial=0.0))
            off = np.abs(np.array(model) / np.array(real) - 1.0)
            late_off = np.abs(np.array(late_model) / np.array(late_real) - 1.0)
            print(
                f"{vehicle.name:12} {maneuver:11} {plan.duration:.2f} s {sum(ended):3} of {flights} pass; "
                f"{100 * np.median(real):5.2f} cm at the median, {100 * max(real):5.2f} cm at most; "
                f"the model {100 * np.median(model):5.2f} cm, {100 * np.median(off):3.0f} % off a flight; "
                f"in the second half {100 * np.median(late_real):.2f} cm, "
                f"the model {100 * np.median(late_model):.2f} cm, {100 * np.median(late_off):.0f} % off",
                flush=True,
            )
            passed += ended
            distances += real
            differences += off.tolist()
            late_differences += late_off.tolist()
    share, median, most = np.mean(passed), np.median(distances), max(distances)
    print(f"{len(passed)} flights in {time.perf_counter() - began:.0f} s")
    for sentence, holds in (
        (f"{100 * share:.1f} % pass, at least {100 * SHARE:.0f} %", share >= SHARE),
        (f"median {100 * median:.2f} cm, below {100 * MEDIAN:.0f} cm", median < MEDIAN),
        (f"most {100 * most:.2f} cm, at most {100 * MOST:.0f} cm", most <= MOST),
        (f"prediction {100 * np.median(differences):.0f} % off, within 30 %", np.median(differences) <= 0.3),
        (
            f"prediction of the second half {100 * np.median(late_differences):.0f} % off, within 30 %",
            np.median(late_differences) <= 0.3,
        ),
    ):
        print("holds:" if holds else "FALLS SHORT:", sentence)


def planned(maneuver: str, vehicle: ab.Vehicle) -> ab.Plan:
    """The plan of a maneuver that passes by the model. Raises Infeasible where there is none."""
    return ab.plan_to_pass(
        maneuver,
        PLANNER,
        vehicle,
        probability=SHARE,
        conditions=CONDITIONS,
        controller="rates",
        workers=1,
    ).plan


if __name__ == "__main__":
    count, *names = sys.argv[1:] or ["20"]
    main(int(count), names or ["agile-quad", "agilicious"])
