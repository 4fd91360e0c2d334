"""The limits of what is possible: over values of two fields, and the least that a problem needs."""

from aerobat.studies.feasibility.axis import Axis
from aerobat.studies.feasibility.feasibility_map import Cell, FeasibilityMap, feasibility_map
from aerobat.studies.feasibility.probe import Feasibility

__all__ = ["Axis", "Cell", "Feasibility", "FeasibilityMap", "feasibility_map"]
