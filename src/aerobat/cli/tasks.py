"""From a command's options to a problem, a vehicle and a plan."""

from __future__ import annotations

from dataclasses import replace
from math import isfinite, radians
from pathlib import Path
from typing import Any, Literal

from aerobat.cli.options import PlanningOptions, TaskOptions, offered_options, option_name
from aerobat.cli.progress import planning_progress
from aerobat.cli.run_record import RunRecord, default_vehicle
from aerobat.cli.terminal import say
from aerobat.errors import SpecError
from aerobat.interchange import read_plan
from aerobat.interchange.robots.description import SUFFIXES, import_vehicle
from aerobat.planning import (
    Plan,
    Planner,
    plan,
    planner_class,
    planner_options,
    with_assessment,
    with_certificate,
    with_flyability,
    with_second_opinion,
)
from aerobat.problem import Problem, load_problem, problem_names
from aerobat.vehicle import Vehicle, implausibilities, load_vehicle


def read_task(name: str, options: TaskOptions, paper: bool = False) -> tuple[Problem, Vehicle]:
    """The problem and the vehicle that a command names."""
    problem = load_problem(name)
    vehicle = named_vehicle(options.vehicle or default_vehicle(paper))
    if options.angle is not None:
        problem = _tilted(problem, options.angle)
    return (problem.as_in_paper() if paper else problem), vehicle


def named_vehicle(name: str) -> Vehicle:
    """The vehicle of that name or file, a robot's among them; what it hardly can be is told, and no more."""
    vehicle = import_vehicle(name) if name.endswith(SUFFIXES) else load_vehicle(name)
    for doubt in implausibilities(vehicle):
        say(f"warning: vehicle '{vehicle.name}': {doubt}")
    return vehicle


def planned(name: str, options: PlanningOptions, command: Literal["fly", "plan"]) -> tuple[Plan, RunRecord]:
    """The plan that a command names, certified for its vehicle, and what it takes to make it again.

    Args:
        name: Of a problem, or a plan's file or folder.
        options: As they were given.
        command: That plans.
    """
    source = plan_source(name)
    if source is not None:
        plan = _read_plan(source, options)
        assert plan.vehicle is not None, "a plan that is read is certified for a vehicle"
        return plan, RunRecord(command=command, problem=plan.problem, vehicle=plan.vehicle, source=name)
    problem, vehicle = read_task(name, options, options.paper)
    record = RunRecord(
        command=command,
        problem=problem,
        vehicle=vehicle,
        planner=make_planner(options),
        paper=options.paper,
        angle=options.angle,
        plugins=tuple(map(str, options.plugins)),
    )
    return plan_of(record), record


def plan_of(record: RunRecord) -> Plan:
    """The plan of a run, made anew."""
    assert record.planner is not None, "a plan that came from a file is not made"
    with planning_progress(record.planner_name) as progress:
        if not record.paper:
            found = plan(record.problem, record.planner, record.vehicle, progress.record)
            return with_second_opinion(found, progress.record)
        # the paper plans without a vehicle; whether this one can fly it is told all the same
        found = plan(record.problem, record.planner, progress=progress.record)
        return _told(found, record.vehicle)


def plan_source(name: str) -> Path | None:
    """The file or folder that holds a plan, where a command names one, and no problem."""
    path = Path(name)
    is_folder = name not in problem_names() and path.is_dir() and path.suffix != ".toml"
    return path if path.suffix == ".plan" or is_folder else None


def make_planner(options: PlanningOptions) -> Planner:
    """The planner that the options name. Raises SpecError for options that belong to another."""
    name = options.planner or "miqp"
    cls = planner_class(name)
    _check_options(options, name)
    settings: dict[str, Any] = {"order": 3} if options.paper else {}
    for option in planner_options(cls):
        given = getattr(options, option_name(option.flag))
        if option.type is bool and given:
            settings[option.name] = not option.default
        elif option.type is not bool and given is not None:
            settings[option.name] = given
        elif option.command_default is not None:
            settings[option.name] = option.command_default
    return cls(**settings)


def _tilted(problem: Problem, angle: float) -> Problem:
    if not (isfinite(angle) and abs(angle) <= 90.0):
        raise SpecError(f"--angle must be from -90 to 90 degrees, got {angle}")
    try:
        gates = problem.maneuver.with_gate_tilt(problem.gates, radians(angle))
    except SpecError as error:
        raise SpecError(f"--angle: '{problem.name}': {error}") from None
    return replace(problem, gates=gates)


def _read_plan(path: Path, options: PlanningOptions) -> Plan:
    """A saved plan, for its own vehicle or another. Raises SpecError for options that plan anew."""
    names = ["planner", "paper", "angle", *(option_name(flag) for flag in offered_options())]
    for name in names:
        if _is_given(getattr(options, name, None)):
            flag = "--" + name.replace("_", "-")
            raise SpecError(f"{flag} plans anew, but {path} is a plan; leave it out, or name a problem")
    found = read_plan(path)
    if not isinstance(found, Plan):
        raise SpecError(f"{path} holds a path alone and no plan; give a .plan file")
    if options.vehicle is not None or found.vehicle is None:
        return _told(found, named_vehicle(options.vehicle or default_vehicle()))
    found = found if found.flyability is not None else with_flyability(found)
    return found if found.assessment is not None else with_assessment(found)


def _told(found: Plan, vehicle: Vehicle) -> Plan:
    """The plan with all that is told of a vehicle which it was not made for."""
    return with_assessment(with_flyability(with_certificate(found, vehicle)))


def _is_given(value: Any) -> bool:
    """True for an option that was given, a zero among them."""
    return value is not None and value is not False


def _check_options(options: PlanningOptions, planner: str) -> None:
    """Refuse options that mean nothing to a planner."""
    for flag, offers in offered_options().items():
        # a planner registered after the command's options were made brings some that nobody can have given
        if planner not in offers and _is_given(getattr(options, option_name(flag), None)):
            takers = " or ".join(offers)
            raise SpecError(f"{flag} is for --planner {takers}, not {planner}; leave one of them out")
    if options.paper and planner != "miqp":
        raise SpecError(f"--paper is for --planner miqp, not {planner}; leave one of them out")
    order = getattr(options, "order", None)
    if options.paper and order not in (None, 3):
        raise SpecError(f"--paper plans with order 3 (jerk), got --order {order}; leave one out")
