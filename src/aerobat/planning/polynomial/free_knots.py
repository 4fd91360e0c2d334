"""Polynomials whose knots are free: nearly time-optimal, certified, from closed forms or the paper's MIQP.

The degree is 9 as in Section V-B. Derivatives at the knots and durations are optimized within the rotors'
limits. The closed form chooses them by a cost that ignores rotors, and loses most of its time by that.
"""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from aerobat.declaration import AS_IT_IS, NonNegative
from aerobat.planning.multi_start import MultiStart
from aerobat.planning.planners import KeptClearance, Planner, Reserve, clearance_option, option, planner
from aerobat.planning.recorder import Progress, Recorder
from aerobat.planning.refinement.refine import MAX_SEGMENTS, SEGMENTS, Refinement
from aerobat.planning.result import FLYING_RESERVE, Plan
from aerobat.planning.time_limit import TIME_LIMIT
from aerobat.planning.warm_start import flown_task
from aerobat.problem.problem import Problem
from aerobat.vehicle import Vehicle


@planner("free-knots")
class FreeKnots(Planner):
    """Polynomials at the rotors' limits, with free derivatives and times at the knots.

    The refinement starts from `start`, a plan of the same problem, certified or not. Without `start` it uses
    the closed form through waypoints and the MIQP's plans with and without a vehicle, and the fastest result
    is kept. Long courses start from the closed form through their stages, at a slower pace where that fails.
    Every stage has a knot. For rotors with lag the limits hold for commands, and thrusts are continuous.
    At the ends the body rate is zero, but the thrust may change: there is jerk along the thrust, unless
    `still_ends` forbids it. A `reserve`, a fraction of the range of rotors and body rate, is kept from either
    end for the controller; for rotors it is proven. Around obstacles the starts are routes on several sides,
    and paths keep a `clearance` from them. A closed course ends in the state of its start (position,
    velocity, attitude, body rates and thrusts), which the planner chooses.
    """

    PLANS_CLOSED_COURSES: ClassVar[bool] = True

    segments: Annotated[int, Field(ge=2, le=MAX_SEGMENTS)] = option(
        4 * SEGMENTS,
        f"How many polynomial segments at most, one a phase between stages at least; paths have {SEGMENTS} "
        "where more gain little. 4 are quick. A course has up to four a leg, or more.",
    )
    start: Annotated[Plan, AS_IT_IS] | None = None
    still_ends: bool = False
    reserve: Reserve = option(
        0.0,
        "The fraction of every limit of the vehicle that is kept from either of its ends for the controller; "
        "with 0 a plan of four segments or more leaves it next to nothing.",
        command_default=FLYING_RESERVE,
    )
    clearance: KeptClearance = clearance_option()  # [m]
    time_limit: NonNegative | None = option(None, TIME_LIMIT)  # [s]

    def plan(
        self, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        """Return the fastest certified plan found, which may be the plan from which the search started.

        Raises SpecError without a vehicle and for invalid input, Infeasible when nothing is certified.
        """
        task = flown_task("free-knots", problem, vehicle, self.reserve, self.clearance)
        refinement = Refinement.of(task, Recorder(progress), self.still_ends)
        return MultiStart("free-knots", refinement, self.segments, self.start).plan(self.time_limit)
