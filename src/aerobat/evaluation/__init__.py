"""Evaluation: scores of flights, and their sensitivity to parameters."""

from aerobat.evaluation.opening import Opening as Opening
from aerobat.evaluation.opening import smallest_opening as smallest_opening
from aerobat.evaluation.score import LapTime as LapTime
from aerobat.evaluation.score import Score as Score
from aerobat.evaluation.score import score as score
from aerobat.evaluation.score_flights import score_flights as score_flights
from aerobat.evaluation.sensitivity import Gradient as Gradient
from aerobat.evaluation.sensitivity import Sensitivity as Sensitivity
from aerobat.evaluation.sensitivity import sensitivity as sensitivity
from aerobat.simulation.passages import Passage as Passage
from aerobat.simulation.passages import WaypointPassage as WaypointPassage
