"""`aerobat fly`: the main job, from a problem to a flight and a report."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from aerobat.cli.failures import ExitCode
from aerobat.cli.options import ExplainingOptions, FlyingOptions, TableOptions
from aerobat.cli.runs.folder import BLACKBOX, Flown, finish, require_place
from aerobat.cli.runs.record import FlightSettings
from aerobat.cli.tasks import flight_settings, plan_of, read_run
from aerobat.control import named_controller
from aerobat.evaluation import score
from aerobat.planning import Plan, nominal_flight
from aerobat.simulation.flight_controller import AUTOPILOTS
from aerobat.simulation.fly import fly as simulate
from aerobat.simulation.plants import PLANTS


def fly(
    problem: str,
    options: TableOptions = TableOptions(),
    flying: FlyingOptions = FlyingOptions(),
    explaining: ExplainingOptions = ExplainingOptions(),
) -> ExitCode:
    """Plan a maneuver, fly it in simulation, and report.

    Prints whether it flies, how long it takes, what limits it and how much margin it has, and writes to the
    output folder, as one: PROBLEM.plan (the whole plan), plan.csv (position, velocity, acceleration and jerk
    at 100 Hz), flight.npz (everything that was simulated), report.png, report.json, and run.toml, from which
    `aerobat repeat` does all of it again. With --autopilot, autopilot.txt has the settings of a real board
    for it, and blackbox.bfl the firmware's own log. Exits with 0 only if the plan is certified, the flight
    went well, and others prove that 95 % of all flights under the conditions succeed; --conditions none
    leaves these out.

    Parameters
    ----------
    problem
        A name that `aerobat show` lists, a problem's TOML file, or a .plan file, a CSV file or a run's
        folder, whose plan is flown as it is.
    """
    PLANTS.instance(flying.plant)
    settings = flight_settings(flying, flying.plant)
    autopilot = AUTOPILOTS.instance(flying.autopilot)
    if autopilot is not None:
        autopilot.require()
    record, saved = read_run(problem, options, "fly", settings)
    require_place(record, options)
    plan = plan_of(record, saved, explaining.explain, flying.workers)
    return finish(plan, record, options, flown(plan, settings), explaining.explain)


def flown(plan: Plan, settings: FlightSettings) -> Flown:
    """The flight of a plan, and its score."""
    vehicle = plan.vehicle
    assert vehicle is not None, "a command plans for a vehicle"
    controller = named_controller(settings.controller, vehicle.controller)
    autopilot = AUTOPILOTS.instance(settings.autopilot)
    given = settings.conditions, settings.plant, settings.autopilot
    by, of_board, own_log = settings.controller, "", b""
    if given == (None, None, None) and controller == vehicle.controller:  # the flight that judged the plan
        flight = nominal_flight(plan.trajectory, vehicle, plan.problem.surroundings)
    else:
        with TemporaryDirectory() as folder:
            log = Path(folder) / BLACKBOX
            flight = simulate(
                plan,
                controller=controller,
                conditions=settings.conditions,
                seed=settings.seed,
                plant=settings.plant,
                autopilot=None if autopilot is None else autopilot.logging_to(str(log)),
            )
            own_log = log.read_bytes() if log.exists() else b""
    if autopilot is not None:
        by = f"{settings.controller} on {settings.autopilot}"
        of_board = autopilot.settings(vehicle, float(np.abs(flight.setpoint.omega_body).max()))
    return Flown(flight, score(flight, plan, vehicle), by, settings.plant, of_board, own_log)
