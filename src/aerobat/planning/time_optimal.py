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
MOST_LEG_SEGMENTS = 8  # largest number of segments of a course's leg


@planner("time-optimal")
class TimeOptimal(Planner):
    """The fastest certified path that is found from many starts; a yardstick for the other planners.

    Starts are the plans of other planners, with and without a vehicle, and their paths at other paces. On a
    course they are the closed forms through its stages, around obstacles the fastest route. All starts are
    refined roughly; `Plan.starts` has the durations. The fastest paths get more segments as long as that
    gains, up to `segments`, or eight a leg on a course. The fastest certified path is returned. A `start`, a
    plan of any planner, is refined alone; other starts follow only if it fails. All limits are used in full,
    which leaves no margin for a controller, unless a `reserve` is kept: a fraction of the range of rotors and
    body rate, from either end.
    """

    PLANS_CLOSED_COURSES: ClassVar[bool] = True

    segments: Annotated[int, Field(ge=2, le=MAX_SEGMENTS)] = option(
        4 * SEGMENTS,
        "How many polynomial segments at most, one a phase between stages at least, eight a leg of a course.",
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
        """Return the fastest certified plan found, which may be a plan from which the search started.

        Raises SpecError without a vehicle and for invalid input, Infeasible when nothing is certified.
        """
        task = flown_task("time-optimal", problem, vehicle, self.reserve, self.clearance)
        refinement = Refinement.of(task, Recorder(progress))
        return MultiStart(
            planner="time-optimal",
            refinement=replace(refinement, high_accuracy=is_course(task.stages)),
            segments=self.segments,
            start=self.start,
            starts=self.starts,
            leg_segments=MOST_LEG_SEGMENTS,
            guess=self.guess,
        ).plan(self.time_limit)
