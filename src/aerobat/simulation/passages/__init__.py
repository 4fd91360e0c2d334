"""Passages of flights: through gates, what the body leaves of their openings; by waypoints; in attitudes."""

from aerobat.simulation.passages.passage import (
    PASSAGE_DEPTH,
    PASSAGE_WINDOW,
    Passage,
    passages,
    plane_directions,
)
from aerobat.simulation.passages.polyline import flown_passages
from aerobat.simulation.passages.stage_attitude import (
    PlannedAttitude,
    StageAttitude,
    flown_attitudes,
    stage_attitudes,
)
from aerobat.simulation.passages.waypoint import WaypointPassage, flown_waypoints, waypoint_passages

__all__ = [
    "PASSAGE_DEPTH",
    "PASSAGE_WINDOW",
    "Passage",
    "PlannedAttitude",
    "StageAttitude",
    "WaypointPassage",
    "flown_attitudes",
    "flown_passages",
    "flown_waypoints",
    "passages",
    "plane_directions",
    "stage_attitudes",
    "waypoint_passages",
]
