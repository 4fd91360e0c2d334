"""Long courses, which no mixed-integer program places in reasonable time."""

from __future__ import annotations

from aerobat.problem.condition import Quantity
from aerobat.problem.stage import Stage, StageSequence

COURSE_STAGES = 6  # that say where they are: from so many on a path through them is the start
MANY_STAGES = 10  # of any kind


def is_course(sequence: StageSequence) -> bool:
    """True of long sequences in order: a closed form is a good start, a mixed-integer plan takes too long."""
    placed = all(map(_placed, sequence.stages))
    return sequence.ordered and len(sequence.stages) >= (COURSE_STAGES if placed else MANY_STAGES)


def _placed(stage: Stage) -> bool:
    """True if a stage says where it is."""
    where = [c for c in stage.conditions if c.quantity is Quantity.POSITION]
    return stage.gate is not None or stage.ball is not None or len(where) >= 3
