"""From a command's options to a problem, a vehicle and a plan."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from math import isfinite, radians
from typing import TYPE_CHECKING, Any

from aerobat.cli.options import PlanningOptions, TaskOptions
from aerobat.errors import SpecError

if TYPE_CHECKING:
    from aerobat.planning import Attempt, Plan, Planner
    from aerobat.problem import Problem
    from aerobat.vehicle import Vehicle

# which planner takes which option, by its name there
TAKES: dict[str, dict[str, str]] = {
    "miqp": {
        "order": "order",
        "intervals": "intervals",
        "backend": "backend",
        "time_limit": "time_limit",
        "paper": "",
    },
    "min-snap": {"order": "order", "stop_after": "stop_after"},
    "free-knots": {"segments": "segments", "reserve": "reserve"},
    "time-optimal": {"reserve": "reserve", "in_space": ""},
}
KINDS = {
    "miqp": "Miqp",
    "min-snap": "MinSnap",
    "free-knots": "FreeKnots",
    "time-optimal": "TimeOptimal",
}  # whose module is loaded when it is asked for
FLOWN_RESERVE = 0.03  # of each rotor's range, where a time-optimal plan is to be flown


def read_task(name: str, options: TaskOptions, paper: bool = False) -> tuple[Problem, Vehicle]:
    """The problem and the vehicle that a command names."""
    from aerobat.documents import within
    from aerobat.problem import load_problem
    from aerobat.vehicle import load_vehicle

    problem = load_problem(name)
    vehicle = load_vehicle(options.vehicle or ("hexarotor" if paper else "agile-quad"))
    if options.angle is not None:
        if not (isfinite(options.angle) and abs(options.angle) <= 90.0):
            raise SpecError(f"--angle must be from -90 to 90 degrees, got {options.angle}")
        with within("--angle: "):
            gates = problem.maneuver.with_gate_tilt(problem.gates, radians(options.angle))
        problem = replace(problem, gates=gates)
    if paper:
        problem = problem.as_in_paper()
    return problem, vehicle


def make_plan(problem: Problem, vehicle: Vehicle, options: PlanningOptions) -> Plan:
    """The plan that the options ask for, with the vehicle's certificate."""
    from aerobat.planning import plan, with_certificate

    planner = make_planner(options)
    with planning_progress() as progress:
        if (
            options.paper
        ):  # the paper plans without a vehicle; whether this one can fly it is told all the same
            return with_certificate(plan(problem, planner, progress=progress), vehicle)
        return plan(problem, planner, vehicle, progress)


def make_planner(options: PlanningOptions) -> Planner:
    """The planner that the options name. Raises SpecError for options that belong to another."""
    from aerobat import planning

    _check_options(options)
    if options.paper and options.order not in (None, 3):
        raise SpecError(f"--paper plans with order 3 (jerk), got --order {options.order}; leave one out")
    defaults: dict[str, dict[str, Any]] = {
        "miqp": {"order": 3} if options.paper else {},
        "min-snap": {},
        "free-knots": {},
        "time-optimal": {"reserve": FLOWN_RESERVE, "planar": not options.in_space},
    }
    given = defaults[options.planner]
    for option, name in TAKES[options.planner].items():
        if name and getattr(options, option) is not None:
            given[name] = getattr(options, option)
    planner: Planner = getattr(planning, KINDS[options.planner])(**given)
    return planner


def _check_options(options: PlanningOptions) -> None:
    for name in {name: None for names in TAKES.values() for name in names}:
        if name not in TAKES[options.planner] and getattr(options, name):
            takers = " or ".join(planner for planner, names in TAKES.items() if name in names)
            flag = "--" + name.replace("_", "-")
            raise SpecError(f"{flag} is for --planner {takers}, not {options.planner}; leave one of them out")


@contextmanager
def planning_progress() -> Iterator[Callable[[Attempt], None] | None]:
    """The attempts as they come, on a terminal; nothing in a pipe."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console

    with Console(stderr=True).status("planning") as status:
        yield lambda a: status.update(f"planning: {a.duration:.3f} s, {a.outcome}")
