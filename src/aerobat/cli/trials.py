"""Flights of a plan under random conditions, which decide whether a real flight is likely to succeed."""

from __future__ import annotations

from aerobat.cli.progress import Progress, showing
from aerobat.cli.runs.record import USUAL_CONDITIONS, RunRecord
from aerobat.control import named_controller
from aerobat.environment import load_dispersion
from aerobat.errors import SpecError
from aerobat.planning import Plan
from aerobat.studies.flights import FlightTask
from aerobat.studies.sweep import Share
from aerobat.studies.trials import Trials, fly_trials


def trial_flights(plan: Plan, record: RunRecord) -> Trials | None:
    """Fly a plan under the run's conditions, or a lab's.

    Of a plan made with --pass the flights that proved it are taken. None is returned where nothing varies,
    for the paper's plans, which leave nothing to the controller, for another simulator's physics, which take
    minutes, and for a vehicle that cannot hover.

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
    if flight.probability is not None and plan.tube is not None:
        return Trials(conditions, flight.seed, Share(plan.tube.passed, plan.tube.flights))
    try:
        plan.vehicle.require_hover(plan.problem.environment.gravity)
    except SpecError:
        return None
    controller = named_controller(flight.controller, plan.vehicle.controller)
    with showing(Progress("flown")) as progress:
        task = FlightTask(plan, plan.vehicle, conditions, flight.seed, controller)
        return fly_trials(task, progress.counting("went well"))
