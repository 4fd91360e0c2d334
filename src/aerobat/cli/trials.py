"""Flights of a plan under random conditions, which decide whether a real flight is likely to succeed."""

from __future__ import annotations

from aerobat.cli.progress import Progress, showing
from aerobat.cli.runs.record import USUAL_CONDITIONS, RunRecord
from aerobat.control import named_controller
from aerobat.environment import load_dispersion
from aerobat.errors import SpecError
from aerobat.planning import Plan
from aerobat.studies.sweep import Sweep
from aerobat.studies.sweep import sweep as sweep_plan

FLIGHTS = 100  # a success rate within a few percent


def trial_flights(plan: Plan, record: RunRecord) -> Sweep | None:
    """Fly a plan under the run's conditions, or a lab's.

    None is returned where nothing varies, for the paper's plans, which leave nothing to the controller, for
    another simulator's physics, which take minutes, and for a vehicle that cannot hover.

    Args:
        plan: The plan, for a vehicle.
        record: The run, whose controller and seed are taken.
    """
    assert plan.vehicle is not None, "a command plans for a vehicle"
    flight = record.flight
    if flight.conditions is None and record.paper:
        return None
    conditions = load_dispersion(USUAL_CONDITIONS) if flight.conditions is None else flight.conditions
    if flight.plant is not None or conditions == load_dispersion("none"):
        return None
    try:
        plan.vehicle.require_hover(plan.problem.environment.gravity)
    except SpecError:
        return None
    controller = named_controller(flight.controller, plan.vehicle.controller)
    with showing(Progress("flown", FLIGHTS)) as progress:
        return sweep_plan(
            plan,
            conditions,
            FLIGHTS,
            flight.seed,
            controller=controller,
            workers=1,  # a hundred flights are over before another process has begun
            progress=progress.counting("went well"),
        )
