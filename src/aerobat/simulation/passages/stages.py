"""Stages without a gate: approaches of flights to waypoints, and of their thrust axis to directions.

Both are searched near the planned instant.
"""

from __future__ import annotations

from math import degrees
from typing import Any

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import by_value
from aerobat.engines.pytree import components
from aerobat.kernels.gates.approach import Approach, Target
from aerobat.kernels.gates.pointing import Direction, Pointing
from aerobat.problem.planned_passage import PlannedWaypoint
from aerobat.simulation.outcome import FlightFailure, Outcome
from aerobat.simulation.passages.passage import PASSAGE_WINDOW, PerFlight

# [m] excess over the radius that is no miss: time-optimal paths touch the ball, and flights deviate slightly
MISS_TOLERANCE = 1e-3


@by_value
class WaypointPassage(PerFlight):
    """The nearest approach to a waypoint near the planned instant; NaN where there is none.

    For many flights, all fields but the first three are arrays (flights,).
    """

    waypoint: str
    lap: int  # of a course
    radius: float  # [m] largest distance allowed
    time: float  # [s] of the approach
    miss: float  # [m] distance from the waypoint at the approach
    speed: float  # [m/s] at the approach
    planned: float  # [s] planned instant; NaN where the flight had ended before

    @property
    def failure(self) -> FlightFailure | None:
        """The failure of one flight at this waypoint; None where nothing is wrong or known."""
        if np.isnan(self.planned) or self.miss <= self.radius + MISS_TOLERANCE:
            return None
        numbers = {"waypoint": self.waypoint, "miss": self.miss, "radius": self.radius}
        return FlightFailure(self.time, Outcome.MISSED_WAYPOINT, numbers)


@by_value
class PlannedAttitude:
    """An attitude that a stage requires at an instant."""

    stage: str
    up: Array  # unit vector along the thrust axis, world, (3,)
    time: float  # [s]
    tolerance: float  # [rad] largest angle allowed between the thrust axis and `up`
    lap: int = 1  # of a course


@by_value
class StageAttitude(PerFlight):
    """The thrust axis where it is nearest to a stage's direction, near the planned instant; NaN: unknown.

    For many flights, all fields but the first three are arrays (flights,).
    """

    stage: str
    lap: int  # of a course
    tolerance_deg: float  # the largest angle allowed
    time: float  # [s] of the smallest angle
    angle_deg: float  # smallest angle between the thrust axis and the planned direction
    planned: float  # [s] planned instant; NaN where the flight had ended before

    @property
    def failure(self) -> FlightFailure | None:
        """The failure of one flight at this stage; None where nothing is wrong or known."""
        if np.isnan(self.planned) or self.angle_deg <= self.tolerance_deg:
            return None
        angles = {"angle": self.angle_deg, "tolerance": self.tolerance_deg}
        return FlightFailure(self.planned, Outcome.MISSED_ATTITUDE, {"stage": self.stage, **angles})


def waypoint_passages(planned: PlannedWaypoint, found: Approach, stop: Array) -> WaypointPassage:
    """Return the approaches of many flights to one waypoint.

    Args:
        planned: the planned passage of the waypoint.
        found: of the vehicles, leaves (flights,).
        stop: when flights diverged [s], NaN for those that did not, (flights,).
    """
    speed = np.linalg.norm(np.stack(found.velocity, axis=-1), axis=-1)
    numbers = _near(planned.time, found.time, stop, miss=np.sqrt(found.square), speed=speed)
    return WaypointPassage(planned.name, planned.lap, planned.ball.radius, **numbers)


def stage_attitudes(planned: PlannedAttitude, found: Pointing, stop: Array) -> StageAttitude:
    """Return the attitudes of many flights at one stage.

    Args:
        planned: the planned attitude.
        found: of the vehicles, leaves (flights,).
        stop: when flights diverged [s], NaN for those that did not, (flights,).
    """
    angle = np.degrees(np.arccos(np.clip(found.cosine, -1.0, 1.0)))
    numbers = _near(planned.time, found.time, stop, angle_deg=angle)
    return StageAttitude(planned.stage, planned.lap, degrees(planned.tolerance), **numbers)


def _near(planned: float, time: Array, stop: Array, **numbers: Array) -> dict[str, Any]:
    """Return time and numbers of flights near a planned instant, and the instant; NaN where unknown."""
    came = np.isfinite(time)
    known = {name: np.where(came, values, np.nan) for name, values in {"time": time, **numbers}.items()}
    return known | {"planned": np.where(came | ~(stop <= planned), planned, np.nan)}


def waypoint_target(planned: PlannedWaypoint) -> Target:
    """Return a planned waypoint as kernels read it, leaves numbers."""
    return Target(components(planned.ball.centre), planned.time, PASSAGE_WINDOW)


def attitude_direction(planned: PlannedAttitude) -> Direction:
    """Return a planned attitude as kernels read it, leaves numbers."""
    return Direction(components(planned.up), planned.time, PASSAGE_WINDOW)
