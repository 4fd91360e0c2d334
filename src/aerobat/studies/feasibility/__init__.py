"""Feasibility over the values of two fields, and the smallest values that a problem needs."""

from aerobat.studies.feasibility.axis import Axis
from aerobat.studies.feasibility.feasibility_map import Cell, FeasibilityMap, feasibility_map
from aerobat.studies.feasibility.min_requirements import Requirement, min_requirements
from aerobat.studies.feasibility.probe import Feasibility

__all__ = [
    "Axis",
    "Cell",
    "Feasibility",
    "FeasibilityMap",
    "Requirement",
    "feasibility_map",
    "min_requirements",
]
