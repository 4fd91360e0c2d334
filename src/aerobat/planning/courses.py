"""Long courses, which no mixed-integer program places in reasonable time, and closed ones, which few can."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar

from aerobat.errors import SpecError
from aerobat.planning.recorder import Progress
from aerobat.planning.result import Plan
from aerobat.problem import Problem, StageSequence
from aerobat.vehicle import Vehicle

P = TypeVar("P")

COURSE_STAGES = 4  # that say where they are: from so many on a path through them is the start
MANY_STAGES = 10  # of any kind


def is_course(sequence: StageSequence) -> bool:
    """True of long sequences in order, and closed ones: a closed form is a good start, a mixed-integer
    plan takes too long, or there is none.
    """
    if sequence.closed:
        return True
    placed = all(len(stage.where) >= 3 for stage in sequence.stages)
    return sequence.ordered and len(sequence.stages) >= (COURSE_STAGES if placed else MANY_STAGES)


def on_open_courses(
    name: str, method: Callable[[P, Problem, Vehicle | None, Progress | None], Plan]
) -> Callable[[P, Problem, Vehicle | None, Progress | None], Plan]:
    """The method `plan` of the planner of that name, which refuses closed courses in a sentence."""

    @wraps(method)
    def plan(
        self: P, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        if not problem.ends:
            raise SpecError(
                f"maneuver.closed: the {name} planner goes from a start to a goal, a closed course has "
                "neither; take time-optimal"
            )
        return method(self, problem, vehicle, progress)

    return plan
