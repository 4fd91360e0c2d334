"""Durations over what is possible: built-in problems × vehicles × angles of the half-flip's gate.

    uv run python benchmarks/possible.py [--planners miqp ...] [--results FILE]

Each problem is planned as the command line plans it, by each planner, and beside it by time-optimal without a
reserve. A row tells the plan's duration, that over the lower bound that its assessment states, that over the
time-optimal plan's, and whether the assessment calls it poor. Rows are appended to the results' file; those
that it holds are not measured again.
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
from typing import Any

from aerobat.planning import plan
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
    print(f"{'vehicle':12} {'problem':24} {'planner':10} {'time-opt.':>9} {'plan':>7} {'/ t-o':>6}  said")
    for vehicle, problem in cases():
        for planner in (YARDSTICK, *options.planners):
            key = f"{vehicle.name} {problem.name} {planner}"
            if key not in known:
                known[key] = measured(problem, vehicle, planner)
                with options.results.open("a") as file:
                    file.write(json.dumps({"key": key, **known[key]}) + "\n")
            if planner != YARDSTICK:
                optimal = known[f"{vehicle.name} {problem.name} {YARDSTICK}"]
                print(line(vehicle.name, problem.name, planner, known[key], optimal), flush=True)


def cases() -> Iterator[tuple[Vehicle, Problem]]:
    """Vehicles, each with every problem, of half-flips one an angle, which its name tells."""
    for vehicle in map(load_vehicle, vehicle_names()):
        for problem in map(load_problem, problem_names()):
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
    made = attempted(lambda: plan(problem, planner_of(planner), vehicle))
    if made.plan is None:
        return {"status": made.status, "message": made.message, "seconds": made.seconds}
    return {"status": made.status, "duration": made.plan.duration, "seconds": made.seconds}


def line(vehicle: str, problem: str, planner: str, row: Row, optimal: Row) -> str:
    begin = f"{vehicle:12} {problem:24} {planner:10}"
    if "duration" not in row or "duration" not in optimal:
        return f"{begin} {row.get('message') or optimal.get('message')}"
    ratio = row["duration"] / optimal["duration"]
    return f"{begin} {optimal['duration']:9.3f} {row['duration']:7.3f} {ratio:6.3f}"


if __name__ == "__main__":
    main()
