"""Polynomials whose knots are free: nearly time-optimal, certified, from closed forms or the paper's MIQP.

Degree 9 as in Section V-B, but derivatives at the knots and durations are chosen by the rotors' limits, not
by a cost that knows nothing of them: that is where the closed form loses most of its time.
"""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from aerobat.declaration import AS_IT_IS, NonNegative
from aerobat.planning.multi_start import MultiStart, quick_guess
from aerobat.planning.planners import KeptClearance, Planner, Reserve, clearance_option, option, planner
from aerobat.planning.recorder import Progress, Recorder
from aerobat.planning.refinement.refine import LEG_SEGMENTS, MAX_SEGMENTS, SEGMENTS, Refinement
from aerobat.planning.result import FLYING_RESERVE, Plan
from aerobat.planning.time_limit import TIME_LIMIT
from aerobat.planning.warm_start import flown_task
from aerobat.problem.problem import Problem
from aerobat.vehicle import Vehicle

# eight, and twice as many segments, gain 0.3 % at the median of 300 random problems, for twice the time
STARTS = 3
FINALISTS = 1  # three gain 0.1 % on average of 91 random problems, for a third more time


@planner("free-knots")
class FreeKnots(Planner):
    """Such polynomials at the rotors' limits, derivatives and times at knots free.

    They begin from `start`, a plan of the same problem, certified or not; without one from the closed
    form through waypoints, the MIQP's plan, and the same without rotors, of which the fastest is kept. A
    course of many stages begins at the closed form through them, stretched where that leads nowhere. A knot
    is at every stage. Rotors that lag are held to their limits by their commands, their thrusts continuous.
    At the ends the body does not turn, but its thrust may be changing, so that there is jerk along it,
    unless `still_ends` asks for none. A `reserve`, a fraction of the range of rotors and body rate, is
    kept from either end for the controller, proven of rotors. Around obstacles they begin from routes on
    several sides, and keep a `clearance` from them. A closed course ends in the state in which it begins,
    of position, velocity, attitude, body rates and thrusts, all of which are chosen.
    """

    PLANS_CLOSED_COURSES: ClassVar[bool] = True

    segments: Annotated[int, Field(ge=2, le=MAX_SEGMENTS)] = option(
        2 * SEGMENTS,
        f"How many polynomial segments at most, one a phase between stages at least; paths have {SEGMENTS} "
        "where more gain little. 4 are quick. A course has two a leg, or more.",
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
        """The fastest certified plan found; where none is faster, the plan that it began from.

        Raises SpecError without a vehicle and for input that makes no sense, Infeasible when nothing is
        certified.
        """
        task = flown_task("free-knots", problem, vehicle, self.reserve, self.clearance)
        return MultiStart(
            planner="free-knots",
            refinement=Refinement.of(task, Recorder(progress), self.still_ends),
            starts=STARTS,
            segments=self.segments,
            leg_segments=LEG_SEGMENTS,
            start=self.start,
            guess=quick_guess(),
            finalists=FINALISTS,
        ).plan(self.time_limit)
