"""The paper's four maneuvers (Section II, IV-A): planned and flown as printed, and as here."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from aerobat.control import Controller, named_controller
from aerobat.evaluation.score import Score, score
from aerobat.planning import Miqp, Plan, plan
from aerobat.problem import load_problem
from aerobat.simulation import Flight, fly
from aerobat.vehicle import Vehicle, load_vehicle

MANEUVERS = ("flip-roll", "flip-roll-translation", "flip-pitch", "half-flip")  # in the order of Section II
HEXAROTOR = "hexarotor"  # what the paper flies
JERK = 3  # the order of the paper's input


@dataclass(frozen=True, eq=False)
class FlownPlan:
    """A plan, its flight and that flight's score."""

    plan: Plan
    vehicle: Vehicle
    flight: Flight
    score: Score


@dataclass(frozen=True, eq=False)
class ManeuverFlights:
    """One maneuver, flown by the paper's hexarotor in two ways."""

    here: FlownPlan  # planned within what its rotors can do, flown by the full controller
    printed: FlownPlan  # planned by the printed program, flown by the printed control law


def printed_plan(name: str) -> Plan:
    """The plan of a built-in problem by the program as printed, with the reference code's parameters."""
    return plan(load_problem(name).as_in_paper(), Miqp(order=JERK), vehicle=None)


@cache  # two figures show it, or three
def maneuver_flights(name: str) -> ManeuverFlights:
    """Plan and fly a built-in problem as here, and as printed."""
    vehicle = load_vehicle(HEXAROTOR)
    return ManeuverFlights(
        flown(plan(load_problem(name), vehicle=vehicle), vehicle),
        flown(printed_plan(name), vehicle, named_controller("paper", vehicle.controller)),
    )


def flown(plan: Plan, vehicle: Vehicle, controller: Controller | None = None) -> FlownPlan:
    """Fly a plan, by the vehicle's own controller unless another is given, and score the flight."""
    flight = fly(plan, vehicle, controller=controller or vehicle.controller)
    return FlownPlan(plan, vehicle, flight, score(flight, plan, vehicle))
