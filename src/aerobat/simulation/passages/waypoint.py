"""Waypoints that flights came by: the nearest approach about the planned instant, against the radius."""

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

# [m] beyond the radius that is no miss: paths of least time touch the ball, and no flight is its path
GRAZING = 1e-3


@by_value
class WaypointPassage(PerFlight):
    """The nearest approach to a waypoint next to the planned instant; NaN where there is none.

    Of many flights, the fields but the first three are arrays (flights,).
    """

    waypoint: str
    lap: int  # of a course
    radius: float  # [m] within which it is met
    time: float  # [s] of the approach
    miss: float  # [m] from the waypoint there
    speed: float  # [m/s]
    planned: float  # [s] when it was to be met; NaN where the flight had ended before

    @property
    def failure(self) -> FlightFailure | None:
        """The mistake of one flight; None where nothing is wrong, or known."""
        if np.isnan(self.planned) or self.miss <= self.radius + GRAZING:
            return None
        numbers = {"waypoint": self.waypoint, "miss": self.miss, "radius": self.radius}
        return FlightFailure(self.time, Outcome.MISSED_WAYPOINT, numbers)


def waypoint_passages(planned: PlannedWaypoint, found: Approach, stop: Array) -> WaypointPassage:
    """Approaches of many flights to one waypoint.

    Args:
        planned: what was to be met.
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
    """A planned waypoint as kernels read it, leaves numbers."""
    return Target(components(planned.ball.centre), planned.time, PASSAGE_WINDOW)
