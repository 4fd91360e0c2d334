"""Plans and flights that many tests look at, each made once in a process."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import aerobat as ab

# a half-flip that has a closed form: more thrust, which others ask in its gate, bends that into the frame
GENTLE = replace(ab.load_problem("half-flip"), maneuver=ab.HalfFlip(min_lateral_thrust=10.0))


@cache
def shared_plan(
    problem: str, vehicle: str | None = "agile-quad", planner: ab.Planner | str | None = None
) -> ab.Plan:
    """Return the plan of a built-in problem by a planner, by default the suited one."""
    return ab.plan(ab.load_problem(problem), planner, None if vehicle is None else ab.load_vehicle(vehicle))


@cache
def shared_flight(problem: str, vehicle: str = "agile-quad") -> ab.Flight:
    """Return the flight of such a plan, by default settings, nothing unknown."""
    return ab.fly(shared_plan(problem, vehicle))


@cache
def closed_form() -> ab.Plan:
    """Return the closed form of a gentle half-flip, which is found at once."""
    return ab.plan(GENTLE, "min-snap", "agile-quad")
