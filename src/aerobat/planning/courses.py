"""Long courses, which no mixed-integer program places in reasonable time, and closed ones, which few can."""

from __future__ import annotations

import numpy as np

from aerobat.problem import Stage, StageSequence

COURSE_STAGES = 6  # that say where they are: from so many on a path through them is the start
POINTS = 4  # gates and waypoints alone, likewise
MANY_STAGES = 10  # of any kind
MAX_EXACT_PLACES = 3  # gates and points that one mixed-integer search places with proof in seconds


def is_course(sequence: StageSequence) -> bool:
    """True of long sequences in order, and closed ones: a closed form is a good start, a mixed-integer
    plan takes too long, or there is none.
    """
    if sequence.closed:
        return True
    needed = MANY_STAGES
    if all(stage.is_placed for stage in sequence.stages):
        needed = POINTS if all(map(_is_point, sequence.stages)) else COURSE_STAGES
    return sequence.ordered and len(sequence.stages) >= needed


def _is_point(stage: Stage) -> bool:
    """True of a gate or a waypoint."""
    return stage.gate is not None or stage.ball is not None or not np.isnan(stage.place).any()


def is_placed_in_windows(sequence: StageSequence) -> bool:
    """True of sequences in order through more places than are searched at once."""
    places = sum(stage.is_placed for stage in sequence.stages)
    return sequence.ordered and places > MAX_EXACT_PLACES
