"""A plan's own flight: the closed loop of its vehicle, simulated before the plan is returned.

A certificate proves that the rotors can follow a path; that the loop of controller and rotors does, lag
included, only a flight shows. What is flown is the plan's trajectory by its vehicle in its environment, with
the default controller and nothing unknown; then once more with the reserve that the certificate leaves used
up, all rotors giving less than commanded by the same fraction δ. As rotors that give (1 − δ) f move a body
as f moves one of 1/(1 − δ) times the mass, inertia and drag, that is what flies then, told otherwise. The
nominal flight is judged at the gates as scores judge flights, their frames included.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from math import isinf, isnan, radians

from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.planning.passages import planned_passages
from aerobat.planning.result import FlownPassage, Flyability, OwnFlight, PlacedStage, Plan
from aerobat.problem.problem import Problem
from aerobat.simulation import Flight, FlightConfig, Outcome, fly
from aerobat.simulation.autopilot import UndeterminedAttitude, recoveries
from aerobat.simulation.outcome import DIVERGENCE_RADIUS
from aerobat.simulation.passages import Passage, flown_passages
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle


def own_flight(
    trajectory: Trajectory, vehicle: Vehicle, problem: Problem, stages: Sequence[PlacedStage]
) -> OwnFlight:
    """The findings of the nominal flight.

    Args:
        trajectory: What is flown.
        vehicle: What flies it.
        problem: Its environment is where, its stages say what is asked of gates.
        stages: Where they are placed.
    """
    flight = nominal_flight(trajectory, vehicle, problem.environment)
    flown = flown_passages(flight, planned_passages(stages, problem), vehicle.bounding_ellipsoid)
    return OwnFlight(
        error=_largest_error(flight), passages=tuple(_flown(passage.of_flight(0)) for passage in flown)
    )


def _flown(passage: Passage) -> FlownPassage:
    error, tolerance = radians(passage.attitude_error_deg), radians(passage.attitude_tolerance_deg)
    failure = ""
    if passage.failure is not None:
        outcome, time, numbers = passage.failure
        failure = outcome.sentence(time=time, gate=f"gate '{passage.gate}'", **numbers)
    return FlownPassage(
        gate=passage.gate,
        attitude_error=None if isnan(error) else error,
        attitude_tolerance=None if isinf(tolerance) else tolerance,
        failure=failure,
        clearance=None if isnan(passage.clearance) else passage.clearance,
    )


def with_flyability(plan: Plan) -> Plan:
    """The plan for a vehicle with the findings of its own flights. Raises SpecError without a vehicle."""
    if plan.vehicle is None:
        raise SpecError("a plan without a vehicle has no flight of its own; plan it for one")
    disturbance = max(plan.certificate.margin or 0.0, 0.0) if plan.certificate else 0.0
    fraction = disturbance / float(plan.vehicle.max_thrusts.max())
    nominal = own_flight(plan.trajectory, plan.vehicle, plan.problem, plan.stages)
    disturbed = disturbed_flight(plan.trajectory, plan.vehicle, plan.problem.environment, fraction)
    return replace(
        plan,
        flyability=Flyability(
            error=nominal.error,
            passages=nominal.passages,
            disturbance=disturbance,
            disturbed_fraction=fraction,
            disturbed_error=_largest_error(disturbed),
        ),
    )


def with_recoveries(plan: Plan) -> Plan:
    """The plan for a vehicle with its recoveries to a hover; without where its attitude is undetermined.

    Raises SpecError without a vehicle.
    """
    if plan.recoveries is not None:
        return plan
    try:
        return replace(plan, recoveries=recoveries(plan))
    except UndeterminedAttitude:
        return plan


@lru_cache(maxsize=2)
def nominal_flight(trajectory: Trajectory, vehicle: Vehicle, environment: Environment) -> Flight:
    """The flight of a plan by default settings, nothing unknown; the latest two are kept."""
    return fly(trajectory, vehicle, environment=environment)


def disturbed_flight(
    trajectory: Trajectory, vehicle: Vehicle, environment: Environment, fraction: float
) -> Flight:
    """The flight of a vehicle whose rotors all give less than commanded.

    Args:
        trajectory: The path [m] over time [s], world.
        vehicle: What flies it.
        environment: Where.
        fraction: Of every rotor's thrust what is missing [-], below 1.
    """
    factor = 1.0 / (1.0 - fraction)
    weak = replace(
        vehicle,
        mass=factor * vehicle.mass,
        inertia=factor * vehicle.inertia,
        drag_body=factor * vehicle.drag_body,
    )
    return fly(trajectory, weak, environment=environment, config=FlightConfig(nominal=vehicle))


def _largest_error(flight: Flight) -> float:
    error = float(flight.position_error.max())
    return error if flight.outcome is Outcome.COMPLETE else max(error, DIVERGENCE_RADIUS)
