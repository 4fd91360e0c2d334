"""Passages of flights: through gates, with the body's clearance; by waypoints; past obstacles."""

from aerobat.simulation.passages.log import log_rows, passages_in_log
from aerobat.simulation.passages.obstacles import (
    FlownBodies,
    NearestObstacle,
    nearest_in_log,
    nearest_obstacles,
)
from aerobat.simulation.passages.passage import Passage, passage_names, passages
from aerobat.simulation.passages.stage_attitude import StageAttitude, stage_attitudes
from aerobat.simulation.passages.waypoint import WaypointPassage, waypoint_passages

__all__ = [
    "FlownBodies",
    "NearestObstacle",
    "Passage",
    "StageAttitude",
    "WaypointPassage",
    "log_rows",
    "nearest_in_log",
    "nearest_obstacles",
    "passage_names",
    "passages",
    "passages_in_log",
    "stage_attitudes",
    "waypoint_passages",
]
