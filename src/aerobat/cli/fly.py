"""`aerobat fly`: the main job, from a problem to a flight and a report."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from aerobat.cli.options import FlyingOptions, PlanningOptions
from aerobat.cli.run_folder import finish
from aerobat.cli.tasks import make_plan, read_task


def fly(
    problem: str,
    options: Annotated[PlanningOptions, Parameter(name="*")] = PlanningOptions(),
    flying: Annotated[FlyingOptions, Parameter(name="*")] = FlyingOptions(),
) -> None:
    """Plan a maneuver, fly it in simulation, and report.

    Prints a short table and writes to the output folder: plan.npz (the polynomials), plan.csv (position,
    velocity, acceleration and jerk at 100 Hz), flight.npz (everything that was simulated), report.png and
    report.json.

    Parameters
    ----------
    problem
        A name that `aerobat problems` lists, or a problem's TOML file.
    """
    from aerobat.evaluation.score import score
    from aerobat.simulation import StateNoise
    from aerobat.simulation import fly as simulate

    noise = StateNoise.fused().scaled(flying.noise) if flying.noise else None
    task, vehicle = read_task(problem, options, options.paper)
    plan = make_plan(task, vehicle, options)
    flight = simulate(plan, vehicle, noise=noise, seed=flying.seed)
    finish(plan, vehicle, options, flight, score(flight, plan, vehicle))
