"""From a command's options to a problem, a vehicle and a plan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import isfinite, radians
from typing import Literal

from aerobat.cli.options import (
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
from aerobat.cli.runs.record import USUAL_CONDITIONS, FlightSettings, RunRecord, default_vehicle
from aerobat.cli.runs.saved_plans import named_vehicle, plan_source, read_saved_plan
from aerobat.cli.terminal import say
from aerobat.control import named_controller
from aerobat.environment import load_dispersion
from aerobat.errors import Infeasible, SpecError
from aerobat.interchange import column_groups
from aerobat.interchange.columns import ALL
from aerobat.optimization.deadline import within_time
from aerobat.planning import (
    Attempt,
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
    """The problem and the vehicle that a command names."""
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
    """Return all that it takes to do a run, and its plan where that is read from a file and not made.

    A plan that is read is certified for its vehicle.

    Args:
        name: Of a problem, or a plan's file or folder.
        options: As they were given.
        command: That plans.
        flight: How the plan is flown.
    """
    source = plan_source(name)
    columns = column_groups(options.columns) if isinstance(options, TableOptions) else ALL
    if source is not None:
        if flight.probability is not None:
            raise SpecError(f"--pass plans anew, and '{name}' is a plan; give a problem, or leave --pass out")
        saved = read_saved_plan(source, options)
        assert saved.vehicle is not None, "a plan that is read is certified for a vehicle"
        record = RunRecord(
            command=command,
            problem=saved.problem,
            vehicle=saved.vehicle,
            source=name,
            flight=flight,
            columns=columns,
        )
        return record, saved
    for flag, value in (("--rate", options.rate), ("--heading", options.heading)):
        if value is not None:
            raise SpecError(f"{flag} is for a CSV file, not for the problem '{name}'; leave it out")
    problem, vehicle = read_task(name, options, options.paper)
    record = RunRecord(
        command=command,
        problem=problem,
        vehicle=vehicle,
        planner=make_planner(options, problem, vehicle, options.paper),
        paper=options.paper,
        angle=options.angle,
        flight=flight,
        columns=columns,
        plugins=tuple(map(str, options.plugins)),
    )
    return record, None


def flight_settings(options: ConditionsOptions, plant: str | None = None) -> FlightSettings:
    """Return the settings by which a plan is flown.

    Args:
        options: As they were given.
        plant: The name of the physics, None for the built-in.

    Raises SpecError for names, or pairs, that cannot fly.
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
    """The name of the controller asked for. Raises SpecError for names, or pairs, that cannot fly."""
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
    """The plan of a run, saved or made anew; explained on request, in what is left of its time.

    Raises Infeasible where there is none; on request with the changes that would help, once it is said that
    there is none.

    Args:
        record: What is planned, and how.
        saved: The plan, where it is not made.
        explain: Whether what takes seconds to know is found out too.
        workers: Who flies what tells whether flights pass.
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
    """The changes with which a problem that was refused is planned."""
    from aerobat.studies.why import Request, explained

    task = Request(record.problem, None if record.paper else record.vehicle, record.planner)
    with showing(Progress("changes tried")) as progress:

        def note(change: str, helps: bool) -> None:
            progress.step(f"{change}: {'planned' if helps else 'no plan'}")

        return explained(refusal, task, note).advice


def _plan_made(record: RunRecord, planner: Planner, explain: bool) -> Plan:
    """The plan that the run's planner finds."""
    limit = getattr(planner, "time_limit", None)
    with showing(PlanningProgress(record.planner_name)) as progress, within_time(limit):
        if record.paper:  # without a vehicle; whether this one can fly it is told all the same
            found = plan(record.problem, planner, progress=progress.record, vehicle=None)
            found = found.for_vehicle(record.vehicle)
        else:
            found = plan(record.problem, planner, record.vehicle, progress.record)
            found = _steadied(found, record, planner, progress.record)
        return with_explanation(found, progress.record) if explain else found


def _steadied(found: Plan, record: RunRecord, planner: Planner, progress: Callable[[Attempt], None]) -> Plan:
    """The plan, or one as fast of which more flights succeed under the run's conditions, or a lab's."""
    from aerobat.studies.passing import steadied

    flight = record.flight
    conditions = flight.conditions
    if conditions is None or conditions == load_dispersion("none"):
        conditions = load_dispersion(USUAL_CONDITIONS)
    return steadied(
        found,
        planner,
        conditions,
        seed=flight.seed,
        controller=flight.controller,
        progress=progress,
    )


def _plan_that_passes(record: RunRecord, planner: Planner, workers: str | None) -> Plan:
    """The plan of a run that is tightened until flights pass."""
    flight = record.flight
    assert flight.probability is not None, "a probability is asked"
    assert flight.conditions is not None, "with conditions"
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
    """The planner that the options name, or one that suits problem and options.

    Args:
        options: As they were given.
        problem: What is planned.
        vehicle: What flies it.
        paper: Whether it is planned as in the paper.

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
    """The name of the planner that suits a problem, or of the usual one, whose options were given."""
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
    """Refuse options that mean nothing to a planner."""
    for flag, offers in offered_options().items():
        # a planner registered after the command's options were made brings some that nobody can have given
        if planner not in offers and is_given(getattr(options, option_name(flag), None)):
            takers = " or ".join(offers)
            raise SpecError(f"{flag} is for --planner {takers}, not {planner}; leave one of them out")


def _check_paper(options: PlannerOptions, planner: str) -> None:
    """Refuse options that the paper's formulation leaves no choice in."""
    if planner != "miqp":
        raise SpecError(f"--paper is for --planner miqp, not {planner}; leave one of them out")
    order = getattr(options, "order", None)
    if order not in (None, 3):
        raise SpecError(f"--paper plans with order 3 (jerk), got --order {order}; leave one out")
