"""Passages of flights: where a gate's plane is crossed, what the body leaves of its opening; by waypoints."""

from aerobat.simulation.passages.passage import (
    PASSAGE_DEPTH,
    PASSAGE_WINDOW,
    Passage,
    passages,
    plane_directions,
)
from aerobat.simulation.passages.polyline import flown_passages
from aerobat.simulation.passages.waypoint import WaypointPassage, flown_waypoints, waypoint_passages

__all__ = [
    "PASSAGE_DEPTH",
    "PASSAGE_WINDOW",
    "Passage",
    "WaypointPassage",
    "flown_passages",
    "flown_waypoints",
    "passages",
    "plane_directions",
    "waypoint_passages",
]
