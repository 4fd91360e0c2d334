"""Flights of a plan under random conditions, for the verdict on it."""

from __future__ import annotations

from aerobat.cli.progress import SweepProgress, showing
from aerobat.cli.runs.record import RunRecord
from aerobat.control import named_controller
from aerobat.environment import load_dispersion
from aerobat.errors import SpecError
from aerobat.planning import Plan
from aerobat.studies.sweep import Sweep
from aerobat.studies.sweep import sweep as sweep_plan

CONDITIONS = "lab"  # where a run names none
FLIGHTS = 100  # a success rate within a few percent


def trial_flights(plan: Plan, record: RunRecord) -> Sweep | None:
    """Fly a plan under the run's conditions, or a lab's; None for a vehicle that cannot hover.

    Args:
        plan: The plan, for a vehicle.
        record: The run, whose controller and seed are taken.
    """
    assert plan.vehicle is not None, "a command plans for a vehicle"
    flight = record.flight
    conditions = load_dispersion(CONDITIONS) if flight.conditions is None else flight.conditions
    controller = named_controller(flight.controller, plan.vehicle.controller)
    try:
        with showing(SweepProgress(FLIGHTS)) as progress:
            return sweep_plan(
                plan, conditions, FLIGHTS, flight.seed, controller=controller, progress=progress.record
            )
    except SpecError:
        return None
