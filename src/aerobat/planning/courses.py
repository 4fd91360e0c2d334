"""Long courses, which no mixed-integer program places in reasonable time."""

from __future__ import annotations

from aerobat.problem.stage import StageSequence

COURSE_STAGES = 6  # that say where they are: from so many on a path through them is the start
MANY_STAGES = 10  # of any kind


def is_course(sequence: StageSequence) -> bool:
    """True of long sequences in order: a closed form is a good start, a mixed-integer plan takes too long."""
    placed = all(len(stage.where) >= 3 for stage in sequence.stages)
    return sequence.ordered and len(sequence.stages) >= (COURSE_STAGES if placed else MANY_STAGES)
