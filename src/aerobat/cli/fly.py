"""`aerobat fly`: the main job, from a problem to a flight and a report."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from aerobat.cli.entry import ExitCode
from aerobat.cli.options import FlyingOptions, PlanningOptions
from aerobat.cli.run_folder import Flown, finish
from aerobat.cli.tasks import planned
from aerobat.control import Controller, named_controller
from aerobat.evaluation import score
from aerobat.planning import nominal_flight
from aerobat.simulation import StateNoise
from aerobat.simulation.fly import fly as simulate


def fly(
    problem: str,
    options: Annotated[PlanningOptions, Parameter(name="*")] = PlanningOptions(),
    flying: Annotated[FlyingOptions, Parameter(name="*")] = FlyingOptions(),
) -> ExitCode:
    """Plan a maneuver, fly it in simulation, and report.

    Prints a short table and writes to the output folder, as one: PROBLEM.plan (the whole plan), plan.csv
    (position, velocity, acceleration and jerk at 100 Hz), flight.npz (everything that was simulated),
    report.png and report.json. Exits with 0 only if the plan is certified and the flight went well.

    Parameters
    ----------
    problem
        A name that `aerobat problems` lists, a problem's TOML file, or a .plan file, which is flown as it is.
    """
    noise = StateNoise.fused().scaled(flying.noise) if flying.noise else None
    controller = named_controller(flying.controller)
    plan = planned(problem, options)
    assert plan.vehicle is not None, "a command plans for a vehicle"
    if noise is None and controller == Controller():  # the flight that the plan was judged by
        flight = nominal_flight(plan.trajectory, plan.vehicle, plan.problem.environment)
    else:
        flight = simulate(plan, controller=controller, noise=noise, seed=flying.seed)
    return finish(plan, options, Flown(flight, score(flight, plan, plan.vehicle), flying.controller))
