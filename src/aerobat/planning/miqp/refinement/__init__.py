"""Paths through fixed slots, refined within what a vehicle can do: variables, constraints and descent."""

from aerobat.planning.miqp.refinement.descent import (
    Descent,
    descent,
    finished,
    on_equal_intervals,
    settled,
)
from aerobat.planning.miqp.refinement.path_program import PathPoint, PathProgram

__all__ = [
    "Descent",
    "PathPoint",
    "PathProgram",
    "descent",
    "finished",
    "on_equal_intervals",
    "settled",
]
