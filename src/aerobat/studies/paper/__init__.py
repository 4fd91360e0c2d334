"""The paper's experiments, done anew: what its figures show, as data."""

from aerobat.studies.paper.hardware import (
    CAUSES,
    OPENINGS,
    TILTS,
    HardwareTrials,
    hardware_causes,
    hardware_trials,
)
from aerobat.studies.paper.maneuvers import MANEUVERS, ManeuverFlights, maneuver_flights, printed_plan
from aerobat.studies.paper.time_search import TimeSearch, time_search

__all__ = [
    "CAUSES",
    "MANEUVERS",
    "OPENINGS",
    "TILTS",
    "HardwareTrials",
    "ManeuverFlights",
    "TimeSearch",
    "hardware_causes",
    "hardware_trials",
    "maneuver_flights",
    "printed_plan",
    "time_search",
]
