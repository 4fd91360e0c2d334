"""`aerobat check`: a proof, or its refutation, for any plan or CSV file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, radians
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from aerobat.certification import Envelope, certify
from aerobat.cli.failures import ExitCode
from aerobat.cli.options import HEADING, POSITIVE, VehicleOptions, limiting
from aerobat.cli.runs.record import default_vehicle
from aerobat.cli.runs.saved_plans import assumed_of_path, named_vehicle, read_source
from aerobat.cli.terminal import print_json
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.planning import Plan, with_explanation
from aerobat.planning.task import Task
from aerobat.reporting.facts import Fact, Facts
from aerobat.reporting.plain_data import plain, to_json
from aerobat.reporting.plans import evidence
from aerobat.reporting.tables import print_table, table
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle, load_vehicle


@dataclass(frozen=True, kw_only=True)
class CheckOptions(VehicleOptions):
    """Limits that a trajectory is checked for, beyond those of its vehicle's rotors and its problem."""

    heading: Annotated[float | None, Parameter(group=limiting, validator=HEADING)] = None
    """The heading at the start in degrees, carried along the path without spin. Default: the plan's
    own, of a CSV file that of its first attitude, or 0."""

    rate: Annotated[float | None, Parameter(group=limiting, validator=POSITIVE)] = None
    """Rows a second of a CSV file without times. Default: 100."""

    max_speed: Annotated[float | None, Parameter(group=limiting, validator=POSITIVE)] = None
    """The greatest speed allowed, m/s."""

    max_tilt: Annotated[float | None, Parameter(group=limiting, validator=POSITIVE)] = None
    """The greatest tilt allowed, degrees from upright."""

    max_rate: Annotated[float | None, Parameter(group=limiting, validator=POSITIVE)] = None
    """The greatest body rate allowed, degrees a second."""

    max_moment: Annotated[float | None, Parameter(group=limiting, validator=POSITIVE)] = None
    """The greatest moment allowed, N m."""


def check(plan: Path, options: CheckOptions = CheckOptions()) -> ExitCode:
    """Prove over continuous time that a vehicle can fly a trajectory, or say when and why it cannot.

    The proof covers every rotor's thrust, its command where it lags, the vehicle's body rate and, where
    limits are given, speed, tilt and moments. The proof does not sample: between any two instants it bounds
    what happens. Of a .plan file the command judges what was planned: its vehicle, its environment, its
    heading, its problem's limits, what its maneuver asks throughout, and each gate as it is passed. Other
    files hold only the path, and what is assumed is said. Beside the proof, the report on a .plan file tells
    how a vehicle that gives the plan up comes back to a hover, and how near the plan is to the shortest
    possible. For a plan that takes suspiciously long, the report adds another planner's second opinion. Exits
    with 0 only if all is proven.

    Parameters
    ----------
    plan
        A .plan file, a CSV file (rows of position, velocity, acceleration, jerk), or a folder that
        `aerobat plan` or `aerobat fly` wrote.
    """
    chosen = None if options.vehicle is None else named_vehicle(options.vehicle)
    found, facts = read_source(plan, options.rate)
    trajectory, own = (found.trajectory, found.vehicle) if isinstance(found, Plan) else (found, None)
    if options.heading is not None:
        trajectory = replace(trajectory, heading=radians(options.heading))
    vehicle = chosen or own or load_vehicle(default_vehicle())
    if isinstance(found, Plan):
        environment = found.problem.environment
        envelope = Task.of(found.problem, vehicle).envelope(found.stages)
        explained, assumed = _explained(found, trajectory, vehicle), []
    else:
        environment, envelope, explained = Environment(), Envelope(), None
        beyond = ("no wind", "no limits, stages or gates of a problem")
        assumed = [*assumed_of_path(options, vehicle, environment), *beyond, *facts]
    envelope = replace(
        envelope,
        speed=options.max_speed or inf,
        tilt=inf if options.max_tilt is None else radians(options.max_tilt),
        body_rate=inf if options.max_rate is None else radians(options.max_rate),
        moment=options.max_moment or inf,
    )
    certificate = certify(trajectory, vehicle, environment, envelope)
    beside = Facts(evidence(explained))
    if options.json:
        print_json(to_json(plain(certificate) | plain(beside) | ({"assumed": assumed} if assumed else {})))
    else:
        print_table(table(certificate, title=f"{plan} · {vehicle.name}"))
        if assumed:
            print(f"judged as a path; assumed: {', '.join(assumed)}")
        elif explained is not None:
            print_table(table(Facts((Fact("", beside, "beside the proof"),))))
    return ExitCode.WELL if certificate.certified else ExitCode.NOT_WELL


def _explained(plan: Plan, trajectory: Trajectory, vehicle: Vehicle) -> Plan | None:
    """The plan, of this path and vehicle, with all that is told of one; None where it cannot be known."""
    if (plan.trajectory, plan.vehicle) != (trajectory, vehicle):
        plan = replace(plan, trajectory=trajectory).for_vehicle(vehicle)
    try:
        return with_explanation(plan)
    except SpecError:  # the vehicle cannot hover, say
        return None
