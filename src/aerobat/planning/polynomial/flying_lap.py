"""A lap of a closed course by the closed form, as the start of a refinement."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerobat.planning.polynomial.knots import path_along_normals, position_at_knot
from aerobat.planning.task import Task
from aerobat.planning.warm_start import WarmStart
from aerobat.problem.end_state import at_rest
from aerobat.problem.maneuvers.line import Line
from aerobat.problem.stage import Stage
from aerobat.trajectory import Trajectory

UNROLLED = 3  # laps in a row; the middle one is a flying lap


def flying_lap(task: Task, order: int) -> WarmStart:
    """Return a flying lap of the closed form through a closed sequence: the middle one of three in a row.

    The three laps begin at rest at the last position and end at rest at the first. The seam between laps
    lies half-way in time between those two positions.

    Args:
        task: A task with a closed course.
        order: The derivative of position whose square is minimized.
    """
    problem, sequence = task.problem, task.stages
    positions = [position_at_knot(stage, task) for stage in sequence.stages]
    places = [position for position in positions if not np.isnan(position).any()] or [np.zeros(3)]
    lap = (Stage("seam"), *sequence.stages)
    laps = replace(sequence, stages=(*UNROLLED * lap, Stage("seam")), closed=False)
    open_ends = replace(problem, maneuver=Line(), start=at_rest(places[-1]), goal=at_rest(places[0]))
    path = path_along_normals(replace(task, problem=open_ends, stages=laps), order)
    first = 1 + len(lap) * (UNROLLED // 2)  # the knot at which the middle lap begins
    segments = slice(first, first + len(lap))
    middle = Trajectory(path.durations[segments], path.coefficients[segments], problem.heading.start)
    return WarmStart(middle, sequence.stages, tuple(middle.knots[1:-1].tolist()))
