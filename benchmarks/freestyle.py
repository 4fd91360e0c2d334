"""Random courses of figures, gates and waypoints, as freestyle pilots string them, planned by default.

Two to four elements for agile-quad, some metres one after another; after a split-s or an Immelmann the course
goes back. Printed are the processor's time and the duration of each, then medians. Courses below the ground
are drawn anew.

uv run python benchmarks/freestyle.py [COUNT] [SEED]
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")  # before NumPy starts its own

import statistics
import sys
import time
from collections.abc import Iterator

import numpy as np

import aerobat as ab

FIGURES = {
    "power-loop": ab.PowerLoop,
    "split-s": ab.SplitS,
    "immelmann": ab.Immelmann,
    "matty-flip": ab.MattyFlip,
    "barrel-roll": ab.BarrelRoll,
    "corkscrew": ab.Corkscrew,
}
OTHERS = ("gate", "gate", "half-flip", "waypoint")
TURNING = ("split-s", "immelmann")  # after which the way goes back
ABOVE = 3.0  # [m] that a split-s begins higher


def main(count: int = 28, seed: int = 7) -> None:
    vehicle = ab.load_vehicle("agile-quad")
    seconds, refused = [], 0
    for problem in courses(count, seed):
        began = time.process_time()
        try:
            found = ab.plan(problem, vehicle=vehicle)
            proof = "certified" if found.certified else "not certified"
            what = f"{found.duration:.3f} s by {found.planner}, {proof}"
        except ab.Infeasible as error:
            what, refused = str(error), refused + 1
        seconds.append(time.process_time() - began)
        print(f"{problem.name}: {seconds[-1]:.1f} s of the processor: {what}", flush=True)
    print(
        f"{count - refused} of {count} planned, in {statistics.median(seconds):.1f} s at the median, "
        f"{max(seconds):.1f} s at most"
    )


def courses(count: int, seed: int) -> Iterator[ab.Problem]:
    """Yield so many courses that stay above the ground."""
    number = 0
    while count:
        rng = np.random.default_rng([seed, number])
        number += 1
        try:
            yield course(rng)
        except ab.SpecError:  # a figure that reaches below the ground
            continue
        count -= 1


def course(rng: np.random.Generator) -> ab.Problem:
    """A course of two to four elements. Raises SpecError for one below the ground."""
    x, ahead, names = 0.0, 1.0, list[str]()
    elements, gates = list[ab.Maneuver](), list[ab.Gate]()
    for number in range(int(rng.integers(2, 5))):
        kind = str(rng.choice([*FIGURES, *OTHERS]))
        x += ahead * rng.uniform(3.5, 6.0)
        height, y = rng.uniform(2.5, 4.5), rng.uniform(-1.5, 1.5)
        place = (x, y, height + ABOVE * (kind == "split-s"))
        heading = 0.0 if ahead > 0.0 else np.pi
        if kind in FIGURES:
            elements.append(FIGURES[kind](place, heading=heading))
        elif kind == "waypoint":
            elements.append(ab.PassWaypoint(place, radius=0.3))
        else:
            tilt = np.deg2rad(rng.uniform(30.0, 90.0)) if kind == "half-flip" else 0.0
            gates.append(ab.tilted_gate(place, tilt=tilt, heading=heading, name=f"gate {number}"))
            passed = gates[-1].name
            speed = float(rng.uniform(2.0, 6.0))
            elements.append(ab.PassGate(passed, speed=speed) if kind == "gate" else ab.HalfFlip(gate=passed))
        names.append(kind)
        ahead = -ahead if kind in TURNING else ahead
    ends = ab.at_rest((0.0, 0.0, 2.0)), ab.at_rest((x + ahead * rng.uniform(3.0, 6.0), 0.0, 2.5))
    flat = ab.Environment(ground=0.0)
    problem = ab.Problem(" - ".join(names), *ends, ab.Course(tuple(elements)), tuple(gates), environment=flat)
    problem.stages(1.0)
    return problem


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
