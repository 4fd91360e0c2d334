"""Passages of flights by waypoints: the nearest approach near the planned instant, and the radius allowed."""

from __future__ import annotations

from typing import Any

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import by_value
from aerobat.engines.pytree import components
from aerobat.kernels.gates.approach import Approach, Target
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


def waypoint_passages(planned: PlannedWaypoint, found: Approach, stop: Array) -> WaypointPassage:
    """Return the approaches of many flights to one waypoint.

    Args:
        planned: the planned passage of the waypoint.
        found: of the vehicles, leaves (flights,).
        stop: when flights diverged [s], NaN for those that did not, (flights,).
    """
    came = np.isfinite(found.time)
    velocity = np.stack(found.velocity, axis=-1)
    numbers: dict[str, Any] = {
        "time": np.where(came, found.time, np.nan),
        "miss": np.where(came, np.sqrt(found.square), np.nan),
        "speed": np.where(came, np.linalg.norm(velocity, axis=-1), np.nan),
        "planned": np.where(came | ~(stop <= planned.time), planned.time, np.nan),
    }
    return WaypointPassage(planned.name, planned.lap, planned.ball.radius, **numbers)


def waypoint_target(planned: PlannedWaypoint) -> Target:
    """Return a planned waypoint as kernels read it, leaves numbers."""
    return Target(components(planned.ball.centre), planned.time, PASSAGE_WINDOW)
