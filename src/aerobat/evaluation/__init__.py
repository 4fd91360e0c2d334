"""Evaluation: scores of flights, and their sensitivity to parameters."""

from aerobat.evaluation.opening import Opening, smallest_opening
from aerobat.evaluation.score import LapTime, Score, score
from aerobat.evaluation.score_flights import score_flights
from aerobat.evaluation.sensitivity import Gradient, Sensitivity, sensitivity
from aerobat.simulation.passages import Passage, WaypointPassage

__all__ = [
    "Gradient",
    "LapTime",
    "Opening",
    "Passage",
    "Score",
    "Sensitivity",
    "WaypointPassage",
    "score",
    "score_flights",
    "sensitivity",
    "smallest_opening",
]
