"""Figures of aerobatics, each of them an element of courses and a maneuver of its own."""

from aerobat.problem.maneuvers.figures.figure import Figure
from aerobat.problem.maneuvers.figures.loops import Immelmann, MattyFlip, PowerLoop, SplitS
from aerobat.problem.maneuvers.figures.passes import InvertedPass, KnifeEdgePass
from aerobat.problem.maneuvers.figures.rolls import BarrelRoll, Corkscrew

__all__ = [
    "BarrelRoll",
    "Corkscrew",
    "Figure",
    "Immelmann",
    "InvertedPass",
    "KnifeEdgePass",
    "MattyFlip",
    "PowerLoop",
    "SplitS",
]
