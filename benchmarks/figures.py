"""Ten figures flown by three vehicles: duration, room, speed, and what their flights come to.

    uv run python benchmarks/figures.py [--planner miqp] [--vehicles agile-quad hexarotor crazyflie]

Each preset is planned as `aerobat fly` plans it, and flown by its own controller. Height is above the
lowest point; room is length by width, along x and y; the error is the flight's largest from its path.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")  # before NumPy starts its own

import argparse
from time import process_time

import numpy as np

import aerobat as ab

FIGURES = (
    "flip-roll",
    "half-flip",
    "power-loop",
    "split-s",
    "immelmann",
    "matty-flip",
    "barrel-roll",
    "corkscrew",
    "knife-edge-pass",
    "inverted-pass",
)
HEADINGS = ("duration", "height", "room", "speed", "certified", "error", "outcome", "planned in")
VEHICLES = ("agile-quad", "hexarotor", "crazyflie")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--planner", default="miqp")
    parser.add_argument("--vehicles", nargs="*", default=VEHICLES)
    options = parser.parse_args()
    print(
        "| figure | vehicle | duration | height | room | speed | certified | error | outcome | planned in |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for figure in FIGURES:
        for vehicle in options.vehicles:
            print(
                f"| {figure} | {vehicle} | {' | '.join(row(figure, vehicle, options.planner))} |", flush=True
            )


def row(figure: str, vehicle: str, planner: str) -> tuple[str, ...]:
    """The facts of one figure flown by one vehicle, or the sentence of its refusal."""
    begin = process_time()
    try:
        plan = ab.plan(figure, planner, vehicle)
    except ab.AerobatError as error:
        return (str(error),)
    seconds = process_time() - begin
    flight = ab.fly(plan)
    score = ab.score(flight, plan)
    times = plan.trajectory.sample(1000.0)
    length, width, height = np.ptp(plan.trajectory.evaluate(times), axis=0)
    speed = np.linalg.norm(plan.trajectory.evaluate(times, 1), axis=1).max()
    return (
        f"{plan.duration:.2f} s",
        f"{height:.1f} m",
        f"{length:.1f} × {width:.1f} m",
        f"{speed:.1f} m/s",
        "yes" if plan.certified else "no",
        f"{100 * score.max_position_error_m:.2g} cm",
        score.outcome.name.lower().replace("_", " "),
        f"{seconds:.1f} s",
    )


if __name__ == "__main__":
    main()
