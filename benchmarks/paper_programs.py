"""The programs that the benchmarks solve: the paper's maneuvers with its numbers."""

from aerobat.optimization import AssignmentProgram
from aerobat.planning.miqp.miqp import formulate
from aerobat.planning.task import Task
from aerobat.problem import load_problem

FLIPS = ("flip-roll", "flip-pitch", "flip-roll-translation")


def paper_program(name: str, intervals: int = 20, duration: float = 2.0) -> AssignmentProgram:
    """A maneuver in paper mode on `intervals` intervals that take `duration` [s] together."""
    return formulate(Task.of(load_problem(name).as_in_paper()), 3, intervals).program(duration / intervals)
