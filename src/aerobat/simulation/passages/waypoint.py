"""Waypoints that flights came by: the nearest approach about the planned instant, against the radius."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from aerobat.arrays import Array
from aerobat.certification import PlannedWaypoint
from aerobat.declaration import by_value
from aerobat.engines.components import components
from aerobat.engines.numpy import ArrayOps
from aerobat.engines.pytree import tree_map
from aerobat.kernels.gates import approach
from aerobat.kernels.gates.approach import Approach
from aerobat.kernels.gates.snapshot import Snapshot
from aerobat.simulation.flight import Flight
from aerobat.simulation.outcome import Outcome
from aerobat.simulation.passages.passage import PASSAGE_WINDOW, one_of_many

T = TypeVar("T")

# [m] beyond the radius that is no miss: paths of least time touch the ball, and no flight is its path
GRAZING = 1e-3


@by_value
@dataclass(frozen=True, eq=False)
class WaypointPassage:
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

    def of_flight(self, k: int) -> WaypointPassage:
        """One flight's of many, in plain numbers."""
        return one_of_many(self, k, shared=3)

    @property
    def failure(self) -> tuple[Outcome, float, dict[str, object]] | None:
        """One flight's failure, when [s], and its numbers; None where nothing is wrong, or known."""
        if np.isnan(self.planned) or self.miss <= self.radius + GRAZING:
            return None
        numbers: dict[str, object] = {"waypoint": self.waypoint, "miss": self.miss, "radius": self.radius}
        return Outcome.MISSED_WAYPOINT, self.time, numbers


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


def flown_waypoints(flight: Flight, planned: tuple[PlannedWaypoint, ...]) -> list[WaypointPassage]:
    """Approaches of one flight that was logged, straight between its rows, fields (1,)."""
    stop = flight.diverged_at
    return [waypoint_passages(each, _nearest(flight, each), stop) for each in planned]


def intervals(flight: Flight, centre: Array | None = None) -> tuple[Snapshot, Snapshot]:
    """The rows of a flight that intervals begin with, and those that they end with, leaves (T - 1,).

    Args:
        flight: one that was logged.
        centre: where positions are counted from [m], (3,).
    """
    states = flight.states
    position = states.position if centre is None else states.position - centre
    rows = Snapshot(flight.times, *map(components, (position, states.velocity, states.q_world_body)))
    return _part(rows, slice(-1)), _part(rows, slice(1, None))


def _nearest(flight: Flight, planned: PlannedWaypoint) -> Approach:
    """The nearest approach within the window, leaves (1,)."""
    each = approach.nearest(ArrayOps, *intervals(flight, planned.ball.centre))
    in_window = np.abs(each.time - planned.time) <= PASSAGE_WINDOW
    if not in_window.any():
        never: Approach = tree_map(np.atleast_1d, approach.init())
        return never
    k = int(np.argmin(np.where(in_window, each.square, np.inf)))
    return _part(each, slice(k, k + 1))


def _part(tree: T, part: slice) -> T:
    """A part of the leaves."""
    cut: T = tree_map(lambda leaf: leaf[part], tree)
    return cut
