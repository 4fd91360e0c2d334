"""Plans and flights that the tests of figures share, each made once."""

from __future__ import annotations

from functools import lru_cache

import aerobat as ab

PROBLEMS = ("flip-roll", "flip-roll-translation", "flip-pitch", "half-flip", "line")


@lru_cache
def planned(problem: str, vehicle: str = "agile-quad") -> ab.Plan:
    """A rotor-feasible plan for one of the shipped problems."""
    return ab.plan(ab.load_problem(problem), vehicle=ab.load_vehicle(vehicle))


@lru_cache
def flown(problem: str, vehicle: str = "agile-quad") -> ab.Flight:
    """A flight of that plan, at a rate that keeps tests short."""
    return ab.fly(planned(problem, vehicle).trajectory, ab.load_vehicle(vehicle), rate=200.0)
