"""The paper's search on times (Section V-D): every path on its way, the last one flown, and the sixth."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from aerobat.planning import MinSnap, Plan, plan
from aerobat.problem import load_problem
from aerobat.studies.paper.maneuvers import FlownPlan, flown
from aerobat.vehicle import Vehicle, load_vehicle

SECTION_V = "section-v"  # the problem, and the vehicle
STOPPED_AFTER = 6  # iterations, in the paper's Fig. 10


@dataclass(frozen=True, eq=False)
class TimeSearch:
    """The plans of a search's iterations, in their order; only the last one is within the rotors' limits."""

    iterations: tuple[Plan, ...]
    vehicle: Vehicle

    @property
    def optimized(self) -> FlownPlan:
        """The last plan, flown (paper, Fig. 9)."""
        return flown(self.iterations[-1], self.vehicle)

    @property
    def stopped(self) -> FlownPlan:
        """The plan of the search stopped early, flown (paper, Fig. 10)."""
        return flown(self.iterations[STOPPED_AFTER - 1], self.vehicle)


@cache  # two figures show it, or three
def time_search() -> TimeSearch:
    """Search as printed, and plan with the search stopped at each iteration before the last."""
    problem, vehicle = load_problem(SECTION_V), load_vehicle(SECTION_V)
    last = plan(problem, MinSnap(), vehicle)
    before = (plan(problem, MinSnap(stop_after=k), vehicle) for k in range(1, len(last.attempts)))
    return TimeSearch((*before, last), vehicle)
