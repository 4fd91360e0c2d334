"""Plans that are read: from a .plan file, a run's folder, or another program's path in a CSV file."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from math import radians
from pathlib import Path

from aerobat.cli.options import PlanningOptions, VehicleOptions, is_given, offered_options, option_name
from aerobat.cli.runs.record import default_vehicle
from aerobat.cli.terminal import say
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.interchange import read_plan, read_rows
from aerobat.interchange.read import plan_file
from aerobat.interchange.robots import SUFFIXES
from aerobat.planning import Plan
from aerobat.problem import EndState, Heading, Problem, load_problem, problem_names
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle, implausibilities, load_vehicle

MADE_BY = "file"  # instead of a planner's name
USUAL_RATE = 100.0  # [1/s] of the rows of a CSV file without times


def plan_source(name: str) -> Path | None:
    """Return the file or folder of a plan that a command names; None for the name of a problem."""
    path = Path(name)
    is_folder = name not in problem_names() and path.suffix != ".toml" and os.path.isdir(path)
    return path if path.suffix in (".plan", ".csv", ".npz") or is_folder else None


def read_saved_plan(path: Path, options: PlanningOptions) -> Plan:
    """Return a saved plan for its own vehicle or another, or a bare path as a plan.

    Raises SpecError for options of planning.
    """
    for flag in ("--planner", "--paper", "--angle", *offered_options()):
        if is_given(getattr(options, option_name(flag), None)):
            raise SpecError(f"{flag} plans anew, but {path} is a plan; leave it out, or name a problem")
    found, facts = read_source(path, options.rate)
    if isinstance(found, Trajectory):
        return _plan_of_path(path, found, facts, options)
    if options.heading is not None:
        raise SpecError(f"--heading is for a CSV file, but {path} is a whole plan; leave it out")
    if options.vehicle is not None or found.vehicle is None:
        return found.for_vehicle(named_vehicle(options.vehicle or default_vehicle()))
    return found


def whole_plan(path: Path, remedy: str) -> Plan:
    """Return the plan in a file or folder. Raises SpecError, with the remedy, for a bare path."""
    found = read_plan(path)
    if not isinstance(found, Plan):
        raise SpecError(f"{path} holds a path alone; {remedy}")
    return found


def named_environment(name: str | None) -> Environment:
    """Return the environment of a problem or a saved plan; the standard one where none is named."""
    if name is None:
        return Environment()
    path = plan_source(name)
    if path is None:
        return load_problem(name).environment
    return whole_plan(path, "name a problem or a .plan file, which have an environment").problem.environment


def read_source(path: Path, rate: float | None) -> tuple[Plan | Trajectory, list[str]]:
    """Return the plan or path in a file or folder, and what reading a CSV file assumed, in words.

    Args:
        path: The file or folder.
        rate: Rows a second [1/s] of a CSV file without times, None for 100. Other files take none.
    """
    path = plan_file(path)
    if rate is not None and path.suffix in (".plan", ".npz"):
        raise SpecError(f"--rate is for a CSV file, not for {path}; leave it out")
    each_second = USUAL_RATE if rate is None else rate
    if path.suffix != ".csv":
        return read_plan(path, each_second), []
    rows = read_rows(path, each_second)
    facts = [] if rows.timed or rate is not None else [f"{USUAL_RATE:g} rows a second (--rate)"]
    if rows.timed and rate is not None:
        facts.append(f"the times of its rows, not the {rate:g} rows a second of --rate")
    facts += [f"{each} left out" for each in rows.unused]
    error = rows.fit_error
    if error is None:
        how_far = "these are too few to tell how far it is off"
    else:
        how_far = f"without every second row it is off by {error:.1g} m"
    return rows.trajectory, [*facts, f"a smooth path between rows ({how_far})"]


def assumed_of_path(options: VehicleOptions, vehicle: Vehicle, environment: Environment) -> list[str]:
    """Return the vehicle, unless the options name it, and the gravity that a bare path is judged with."""
    own = [] if options.vehicle else [f"the vehicle {vehicle.name}"]
    return [*own, f"gravity {environment.gravity:g} m/s²"]


def named_vehicle(name: str) -> Vehicle:
    """Return the vehicle of a name, a file or a robot's file; warn of implausible properties."""
    if name.endswith(SUFFIXES):
        from aerobat.interchange.robots import import_vehicle

        vehicle = import_vehicle(name)
    else:
        vehicle = load_vehicle(name)
    for doubt in implausibilities(vehicle):
        say(f"warning: vehicle '{vehicle.name}': {doubt}")
    return vehicle


def _plan_of_path(path: Path, trajectory: Trajectory, facts: list[str], options: PlanningOptions) -> Plan:
    """Return a bare path as the plan of a line from its first point to its last; print the assumptions."""
    vehicle = named_vehicle(options.vehicle or default_vehicle())
    if options.heading is not None:
        trajectory = replace(trajectory, heading=radians(options.heading))
    start, goal = (
        EndState(trajectory.evaluate(end), trajectory.evaluate(end, 1), trajectory.evaluate(end, 2))
        for end in (0.0, trajectory.duration)
    )
    name = re.sub(r"[^\w .-]|^\W+", "-", path.stem).lstrip(" .-") or MADE_BY
    problem = Problem(name=name, start=start, goal=goal, heading=Heading(trajectory.heading))
    vehicle.require_hover(problem.environment.gravity)
    plan = Plan(problem=problem, trajectory=trajectory, planner=MADE_BY, status="as it is").for_vehicle(
        vehicle
    )
    assumed = assumed_of_path(options, vehicle, problem.environment)
    say(f"{path} holds a path alone; assumed: {', '.join([*assumed, 'no wind, limits or gates', *facts])}")
    return plan
