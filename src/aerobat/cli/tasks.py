"""From a command's options to a problem, a vehicle and a plan."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from math import isfinite, radians
from typing import Literal

from aerobat.cli.options import (
    USUAL_CONDITIONS,
    ConditionsOptions,
    PlannerOptions,
    PlanningOptions,
    ProblemOptions,
    TableOptions,
    is_given,
    offered_options,
    option_name,
)
from aerobat.cli.progress import PlanningProgress, Progress, showing
from aerobat.cli.runs.record import FlightSettings, RunRecord, default_vehicle
from aerobat.cli.runs.saved_plans import named_vehicle, plan_source, read_saved_plan
from aerobat.cli.terminal import say
from aerobat.control import named_controller
from aerobat.environment import load_dispersion
from aerobat.errors import Infeasible, SpecError
from aerobat.interchange import column_groups
from aerobat.interchange.columns import ALL
from aerobat.optimization.deadline import within_time
from aerobat.planning import (
    Plan,
    Planner,
    command_settings,
    plan,
    planner_class,
    planner_options,
    suited_planner,
    with_explanation,
)
from aerobat.problem import Problem, load_problem
from aerobat.simulation.flight_controller import AUTOPILOTS
from aerobat.vehicle import Vehicle


def read_task(name: str, options: ProblemOptions, paper: bool = False) -> tuple[Problem, Vehicle]:
    """Return the problem and the vehicle that a command names."""
    problem = load_problem(name)
    vehicle = named_vehicle(options.vehicle or default_vehicle(paper))
    if options.angle is not None:
        problem = _tilted(problem, options.angle)
    return (problem.as_in_paper() if paper else problem), vehicle


def read_run(
    name: str,
    options: PlanningOptions,
    command: Literal["fly", "plan", "sweep"],
    flight: FlightSettings = FlightSettings(),
) -> tuple[RunRecord, Plan | None]:
    """Return the record of a run, and its plan where that is read from a file.

    A plan that is read is certified for its vehicle.

    Args:
        name: The name of a problem, or the file or folder of a plan.
        options: The given options.
        command: The command that plans.
        flight: The settings of the flight.
    """
    source = plan_source(name)
    columns = column_groups(options.columns) if isinstance(options, TableOptions) else ALL
    made = partial(RunRecord, command=command, flight=flight, columns=columns, plugins=options.plugin_names)
    if source is not None:
        if flight.probability is not None:
            raise SpecError(f"--pass plans anew, and '{name}' is a plan; give a problem, or leave --pass out")
        saved = read_saved_plan(source, options)
        assert saved.vehicle is not None, "a plan that is read is certified for a vehicle"
        return made(problem=saved.problem, vehicle=saved.vehicle, source=name), saved
    for flag, value in (("--rate", options.rate), ("--heading", options.heading)):
        if value is not None:
            raise SpecError(f"{flag} is for a CSV file, not for the problem '{name}'; leave it out")
    problem, vehicle = read_task(name, options, options.paper)
    planner = make_planner(options, problem, vehicle, options.paper)
    return made(
        problem=problem, vehicle=vehicle, planner=planner, paper=options.paper, angle=options.angle
    ), None


def flight_settings(options: ConditionsOptions, plant: str | None = None) -> FlightSettings:
    """Return the settings by which a plan is flown.

    Args:
        options: The given options.
        plant: The name of another simulator, None for the built-in one.

    Raises SpecError for unknown names, and for options that exclude each other.
    """
    named = options.conditions
    if named is None and options.probability is not None:
        named = USUAL_CONDITIONS
    conditions = None if named is None else load_dispersion(named)
    if options.workers is not None and options.probability is None:
        raise SpecError("--workers fly for --pass; give that too, or leave --workers out")
    return FlightSettings(
        _controller(options),
        conditions,
        options.seed,
        plant=plant,
        autopilot=options.autopilot,
        probability=options.probability,
    )


def _controller(options: ConditionsOptions) -> str:
    """Return the controller's name. Raises SpecError for unknown names and for an unfit autopilot."""
    name = options.controller or ("full" if options.autopilot is None else "rates")
    gives_rates = getattr(named_controller(name), "GIVES_RATES", False)
    if AUTOPILOTS.instance(options.autopilot) is not None and not gives_rates:
        raise SpecError(
            f"--autopilot {options.autopilot} holds body rates, which --controller {name} does not give; "
            "leave --controller out"
        )
    return name


def plan_of(
    record: RunRecord, saved: Plan | None = None, explain: bool = False, workers: str | None = None
) -> Plan:
    """Return the plan of a run, read or planned; with an explanation if it is requested and time is left.

    Raises Infeasible where no plan is found. If an explanation is requested, this failure is reported at
    once, and the error names the changes that would help.

    Args:
        record: The run.
        saved: The plan, if it was read from a file.
        explain: Whether to find the facts that take seconds, too.
        workers: The workers of the flights for --pass.
    """
    if saved is not None:
        return with_explanation(saved) if explain else saved
    planner = record.planner
    assert planner is not None, "a plan that came from a file is not made"
    if record.flight.probability is not None:
        found = _plan_that_passes(record, planner, workers)
        return with_explanation(found) if explain else found
    try:
        return _plan_made(record, planner, explain)
    except Infeasible as refusal:
        if not explain:
            raise
        say(refusal.sentence)
        raise Infeasible(_advice(record, refusal)) from None


def _advice(record: RunRecord, refusal: Infeasible) -> str:
    """Return the changes with which a plan for an infeasible problem is found."""
    from aerobat.studies.why import Request, explained

    task = Request(record.problem, None if record.paper else record.vehicle, record.planner)
    with showing(Progress("changes tried")) as progress:

        def note(change: str, helps: bool) -> None:
            progress.step(f"{change}: {'planned' if helps else 'no plan'}")

        return explained(refusal, task, note).advice


def _plan_made(record: RunRecord, planner: Planner, explain: bool) -> Plan:
    """Return the plan that the run's planner finds."""
    limit = getattr(planner, "time_limit", None)
    with showing(PlanningProgress(record.planner_name)) as progress, within_time(limit):
        if record.paper:  # planned without a vehicle, then certified for this one
            found = plan(record.problem, planner, progress=progress.record, vehicle=None)
            found = found.for_vehicle(record.vehicle)
        else:
            from aerobat.studies.passing import steadied

            found = plan(record.problem, planner, record.vehicle, progress.record)
            flight, conditions = record.flight, record.flight.conditions
            if conditions is None or conditions == load_dispersion("none"):
                conditions = load_dispersion(USUAL_CONDITIONS)
            found = steadied(
                found,
                planner,
                conditions,
                seed=flight.seed,
                controller=flight.controller,
                progress=progress.record,
            )
        return with_explanation(found, progress.record) if explain else found


def _plan_that_passes(record: RunRecord, planner: Planner, workers: str | None) -> Plan:
    """Return the plan of a run, with a reserve with which flights pass with the requested probability."""
    flight = record.flight
    assert flight.probability is not None, "--pass was given"
    assert flight.conditions is not None, "--pass has conditions by default"
    if record.paper:
        raise SpecError("--pass keeps a reserve, the paper none; leave out --pass or --paper")
    from aerobat.studies.passing import plan_to_pass

    with showing(PlanningProgress(record.planner_name)) as progress:
        return plan_to_pass(
            record.problem,
            planner,
            record.vehicle,
            probability=flight.probability,
            conditions=flight.conditions,
            seed=flight.seed,
            controller=flight.controller,
            workers=workers,
            progress=progress.record,
            tried=progress.tried,
        ).plan


def make_planner(options: PlannerOptions, problem: Problem, vehicle: Vehicle, paper: bool = False) -> Planner:
    """Return the planner that the options name, or one that suits the problem and the options.

    Args:
        options: The given options.
        problem: The problem to plan.
        vehicle: The vehicle to plan for.
        paper: Whether to plan as in the paper.

    Raises:
        SpecError: Options belong to another planner.
    """
    name = options.planner or ("miqp" if paper else _suited(options, problem, vehicle))
    cls = planner_class(name)
    _check_options(options, name)
    if paper:
        _check_paper(options, name)
    settings = command_settings(cls) | ({"order": 3} if paper else {})
    for option in planner_options(cls):
        given = getattr(options, option_name(option.flag))
        if option.type is bool and given:
            settings[option.name] = not option.default
        elif option.type is not bool and given is not None:
            settings[option.name] = given
    return cls(**settings)


def _suited(options: PlannerOptions, problem: Problem, vehicle: Vehicle) -> str:
    """Return the planner's name that suits a problem, or the usual one if options of others were given."""
    name = suited_planner(problem, vehicle)
    try:
        _check_options(options, name)
    except SpecError:
        return "miqp"
    return name


def _tilted(problem: Problem, angle: float) -> Problem:
    if not (isfinite(angle) and abs(angle) <= 90.0):
        raise SpecError(f"--angle must be from -90 to 90 degrees, got {angle}")
    try:
        gates = problem.maneuver.with_gate_tilt(problem.gates, radians(angle))
    except SpecError as error:
        raise SpecError(f"--angle: '{problem.name}': {error}") from None
    return replace(problem, gates=gates)


def _check_options(options: PlannerOptions, planner: str) -> None:
    """Raise SpecError for options of other planners."""
    for flag, offers in offered_options().items():
        # options of a planner that was registered after the class of options was made are not fields of it
        if planner not in offers and is_given(getattr(options, option_name(flag), None)):
            takers = " or ".join(offers)
            raise SpecError(f"{flag} is for --planner {takers}, not {planner}; leave one of them out")


def _check_paper(options: PlannerOptions, planner: str) -> None:
    """Raise SpecError for options that contradict the paper's formulation."""
    if planner != "miqp":
        raise SpecError(f"--paper is for --planner miqp, not {planner}; leave one of them out")
    order = getattr(options, "order", None)
    if order not in (None, 3):
        raise SpecError(f"--paper plans with order 3 (jerk), got --order {order}; leave one out")
