"""Passages of flights: through gates, with the body's clearance; by waypoints; past obstacles."""

from aerobat.simulation.passages.log import log_rows as log_rows
from aerobat.simulation.passages.log import passages_in_log as passages_in_log
from aerobat.simulation.passages.obstacles import FlownBodies as FlownBodies
from aerobat.simulation.passages.obstacles import NearestObstacle as NearestObstacle
from aerobat.simulation.passages.obstacles import nearest_in_log as nearest_in_log
from aerobat.simulation.passages.obstacles import nearest_obstacles as nearest_obstacles
from aerobat.simulation.passages.passage import Passage as Passage
from aerobat.simulation.passages.passage import passage_names as passage_names
from aerobat.simulation.passages.passage import passages as passages
from aerobat.simulation.passages.stages import StageAttitude as StageAttitude
from aerobat.simulation.passages.stages import WaypointPassage as WaypointPassage
from aerobat.simulation.passages.stages import stage_attitudes as stage_attitudes
from aerobat.simulation.passages.stages import waypoint_passages as waypoint_passages
