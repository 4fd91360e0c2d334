"""Long courses, which no mixed-integer program places in reasonable time."""

from __future__ import annotations

from aerobat.problem.stage import StageSequence

COURSE_STAGES = 6  # that say where they are: from so many on a path through them is the start
MANY_STAGES = 10  # of any kind
MAX_EXACT_PLACES = 3  # gates and points that one mixed-integer search places with proof in seconds


def is_course(sequence: StageSequence) -> bool:
    """True of long sequences in order: a closed form is a good start, a mixed-integer plan takes too long."""
    placed = all(len(stage.where) >= 3 for stage in sequence.stages)
    return sequence.ordered and len(sequence.stages) >= (COURSE_STAGES if placed else MANY_STAGES)


def is_placed_in_windows(sequence: StageSequence) -> bool:
    """True of sequences in order through more places than are searched at once."""
    places = sum(len(stage.where) >= 3 for stage in sequence.stages)
    return sequence.ordered and places > MAX_EXACT_PLACES
