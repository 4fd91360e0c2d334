"""Courses: long sequences of stages, too long for an exact mixed-integer search, and closed ones."""

from __future__ import annotations

import numpy as np

from aerobat.problem import Stage, StageSequence

COURSE_STAGES = 6  # number of stages from which a sequence is a course, if all have positions
POINTS = 4  # the same, if all are gates or waypoints
MANY_STAGES = 10  # the same, for stages of any kind
MAX_EXACT_PLACES = 3  # largest number of positions that one mixed-integer search solves exactly in seconds


def is_course(sequence: StageSequence) -> bool:
    """Return whether a sequence is closed, or ordered and long: the closed form is then the best start.

    A mixed-integer plan of such a sequence takes too long, or does not exist.
    """
    if sequence.closed:
        return True
    needed = MANY_STAGES
    if all(stage.is_placed for stage in sequence.stages):
        needed = POINTS if all(map(_is_point, sequence.stages)) else COURSE_STAGES
    return sequence.ordered and len(sequence.stages) >= needed


def _is_point(stage: Stage) -> bool:
    """Return whether a stage is a gate or a waypoint."""
    return stage.gate is not None or stage.ball is not None or not np.isnan(stage.place).any()


def is_placed_in_windows(sequence: StageSequence) -> bool:
    """Return whether an ordered sequence has too many positions for one search, so that windows are used."""
    places = sum(stage.is_placed for stage in sequence.stages)
    return sequence.ordered and places > MAX_EXACT_PLACES
