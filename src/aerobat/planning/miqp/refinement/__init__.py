"""Paths through fixed slots, refined within what a vehicle can do: variables, constraints and descent."""

from aerobat.planning.miqp.refinement.descent import descended, finished, settled
from aerobat.planning.miqp.refinement.path_program import PathPoint, PathProgram

__all__ = ["PathPoint", "PathProgram", "descended", "finished", "settled"]
