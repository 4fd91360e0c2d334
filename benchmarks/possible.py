"""Durations over what is possible: built-in problems × vehicles × angles of the half-flip's gate.

    uv run python benchmarks/possible.py [--planners miqp ...] [--results FILE]

Each problem is planned as the command line plans it, by each planner, and beside it by time-optimal without a
reserve. A row tells the lower bound, both durations over it, the plan's over the time-optimal one's, and what
the plan's assessment says where that is more than 1.4. Rows are appended to the results' file; those that it
holds are not measured again.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")  # before NumPy starts its own

import argparse
import json
from collections.abc import Iterator
from dataclasses import replace
from math import radians
from pathlib import Path
from time import process_time
from typing import Any

from aerobat.planning import least_duration, plan, with_second_opinion
from aerobat.planning.assessment.assessment import POOR
from aerobat.problem import Problem, load_problem, problem_names
from aerobat.vehicle import Vehicle, load_vehicle, vehicle_names
from audit_measures import YARDSTICK, attempted, planner_of

ANGLES_DEG = (15, 30, 45, 60, 75, 90)  # of the half-flip's gate
Row = dict[str, Any]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--planners", nargs="*", default=["miqp"])
    parser.add_argument("--results", type=Path, default=Path("out/possible.jsonl"))
    options = parser.parse_args()
    options.results.parent.mkdir(parents=True, exist_ok=True)
    known = dict(read_rows(options.results))
    heads = ("bound", "t-o", "plan", "t-o / b", "p / b", "p / t-o")
    print(f"{'vehicle':12} {'problem':22} {'planner':10}", *(f"{head:>8}" for head in heads))
    unexplained = 0
    for vehicle, problem in cases():
        for planner in (YARDSTICK, *options.planners):
            key = f"{vehicle.name} {problem.name} {planner}"
            if key not in known:
                known[key] = measured(problem, vehicle, planner)
                with options.results.open("a") as file:
                    file.write(json.dumps({"key": key, **known[key]}) + "\n")
            if planner != YARDSTICK:
                optimal = known[f"{vehicle.name} {problem.name} {YARDSTICK}"]
                print(f"{vehicle.name:12} {problem.name:22} {planner:10}", end=" ")
                unexplained += tell(known[key], optimal, least_duration(problem, vehicle))
    print(f"{unexplained} of more than {POOR} times time-optimal's duration that do not say so")


def cases() -> Iterator[tuple[Vehicle, Problem]]:
    """Vehicles, each with every problem, of half-flips one an angle, which its name tells."""
    for vehicle in map(load_vehicle, vehicle_names()):
        for problem in map(load_problem, problem_names()):
            if problem.maneuver.kind == "course":  # of more legs than all planners here take
                continue
            if problem.name != "half-flip":
                yield vehicle, problem
                continue
            for angle_deg in ANGLES_DEG:
                gates = problem.maneuver.with_gate_tilt(problem.gates, radians(angle_deg))
                yield vehicle, replace(problem, gates=gates, name=f"half-flip {angle_deg}")


def read_rows(path: Path) -> Iterator[tuple[str, Row]]:
    if path.exists():
        for text in path.read_text().splitlines():
            row = json.loads(text)
            yield row["key"], row


def measured(problem: Problem, vehicle: Vehicle, planner: str) -> Row:
    """A plan's duration and what is said of it; of the yardstick the duration alone."""
    made = attempted(lambda: plan(problem, planner_of(planner), vehicle))
    if made.plan is None:
        return {"status": made.status, "message": made.message, "seconds": made.seconds}
    row: Row = {"status": made.status, "duration": made.plan.duration, "seconds": made.seconds}
    if planner == YARDSTICK:
        return row
    began = process_time()
    said = with_second_opinion(made.plan).assessment
    assert said is not None
    return row | {"poor": said.poor, "said": str(said), "opinion_seconds": process_time() - began}


def tell(row: Row, optimal: Row, bound: float) -> bool:
    """Print the numbers of a row; true if it is poor and does not say so."""
    if "duration" not in row or "duration" not in optimal:
        print(row.get("message") or optimal.get("message"), flush=True)
        return False
    ours, best = row["duration"], optimal["duration"]
    numbers = (bound, best, ours, best / bound, ours / bound, ours / best)
    far = ours > POOR * best
    print(*(f"{number:8.3f}" for number in numbers), row["said"] if far else "", flush=True)
    return far and not row["poor"]


if __name__ == "__main__":
    main()
