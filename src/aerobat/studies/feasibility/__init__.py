"""Feasibility over the values of two fields, and the smallest values that a problem needs."""

from aerobat.studies.feasibility.axis import Axis as Axis
from aerobat.studies.feasibility.feasibility_map import Cell as Cell
from aerobat.studies.feasibility.feasibility_map import FeasibilityMap as FeasibilityMap
from aerobat.studies.feasibility.feasibility_map import feasibility_map as feasibility_map
from aerobat.studies.feasibility.min_requirements import Requirement as Requirement
from aerobat.studies.feasibility.min_requirements import min_requirements as min_requirements
from aerobat.studies.feasibility.probe import Feasibility as Feasibility
