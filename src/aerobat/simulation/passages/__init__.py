"""Passages of flights: through gates, as far as the body leaves them; by waypoints; past obstacles."""

from aerobat.simulation.passages.log import log_rows, passages_in_log, scan_log
from aerobat.simulation.passages.obstacles import (
    FlownBodies,
    NearestObstacle,
    nearest_in_log,
    nearest_obstacles,
)
from aerobat.simulation.passages.passage import (
    PASSAGE_WINDOW,
    Passage,
    bounding_ellipsoid,
    gate_places,
    passages,
)
from aerobat.simulation.passages.stage_attitude import (
    PlannedAttitude,
    StageAttitude,
    attitude_direction,
    stage_attitudes,
)
from aerobat.simulation.passages.waypoint import WaypointPassage, waypoint_passages, waypoint_target

__all__ = [
    "PASSAGE_WINDOW",
    "FlownBodies",
    "NearestObstacle",
    "Passage",
    "PlannedAttitude",
    "StageAttitude",
    "WaypointPassage",
    "attitude_direction",
    "bounding_ellipsoid",
    "gate_places",
    "log_rows",
    "nearest_in_log",
    "nearest_obstacles",
    "passages",
    "passages_in_log",
    "scan_log",
    "stage_attitudes",
    "waypoint_passages",
    "waypoint_target",
]
