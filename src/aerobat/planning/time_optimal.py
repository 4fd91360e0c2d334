"""The fastest plan that is found: from many starts, the best of them with many segments."""

from __future__ import annotations

from dataclasses import field, replace
from typing import Annotated, ClassVar

from pydantic import Field

from aerobat.declaration import AS_IT_IS, NonNegative
from aerobat.planning.courses import is_course
from aerobat.planning.miqp.miqp import Miqp
from aerobat.planning.multi_start import MultiStart, quick_guess
from aerobat.planning.planners import KeptClearance, Planner, Reserve, clearance_option, option, planner
from aerobat.planning.recorder import Progress, Recorder
from aerobat.planning.refinement.refine import MAX_SEGMENTS, SEGMENTS, Refinement
from aerobat.planning.result import FLYING_RESERVE, Plan
from aerobat.planning.time_limit import TIME_LIMIT
from aerobat.planning.warm_start import flown_task
from aerobat.problem.problem import Problem
from aerobat.vehicle import Vehicle

STARTS = 8
FINALISTS = 3  # of the fastest paths
LEG_SEGMENTS = 4  # of a course's leg


@planner("time-optimal")
class TimeOptimal(Planner):
    """The fastest certified path that is found from many starts; a yardstick for the other planners.

    Starts are the plans of other planners, with and without rotors, and the same at other paces; on a course
    the closed forms through its stages, around obstacles the fastest way past them. All of them are refined
    roughly; `Plan.starts` has their durations. The fastest get more polynomials as long as that gains, up to
    `segments`, a course four a leg, and the fastest that is certified is returned. A `start`, a plan of
    whichever planner, is refined alone, and others where it leads nowhere. Each limit is used in full, which
    leaves nothing for a controller: `reserve`, a fraction of the range of rotors and body rate, is kept from
    either end for it.
    """

    PLANS_CLOSED_COURSES: ClassVar[bool] = True

    segments: Annotated[int, Field(ge=2, le=MAX_SEGMENTS)] = option(
        4 * SEGMENTS,
        "How many polynomial segments at most, one a phase between stages at least; a course has four a leg.",
    )
    reserve: Reserve = option(
        0.0,
        "The fraction of every limit of the vehicle that is kept from either of its ends for the controller; "
        "with 0 a time-optimal plan is a yardstick that no controller follows for sure.",
        command_default=FLYING_RESERVE,
    )
    clearance: KeptClearance = clearance_option()  # [m]
    starts: Annotated[int, Field(ge=1)] = option(
        STARTS, "The number of starts; more find a faster local optimum at times, and take longer."
    )
    time_limit: NonNegative | None = option(None, TIME_LIMIT)  # [s]
    guess: Miqp = field(default_factory=quick_guess)
    start: Annotated[Plan, AS_IT_IS] | None = None

    def plan(
        self, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        """The fastest certified plan found; where none is faster, a plan that it began from.

        Raises SpecError without a vehicle and for input that makes no sense, Infeasible when nothing is
        certified.
        """
        task = flown_task("time-optimal", problem, vehicle, self.reserve, self.clearance)
        refinement = Refinement.of(task, Recorder(progress))
        return MultiStart(
            planner="time-optimal",
            refinement=replace(refinement, close=is_course(task.stages)),
            starts=self.starts,
            segments=self.segments,
            leg_segments=LEG_SEGMENTS,
            start=self.start,
            guess=self.guess,
            finalists=FINALISTS,
        ).plan(self.time_limit)
