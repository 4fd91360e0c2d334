"""Attitudes of flights at stages: the nearest of the thrust axis near the planned instant."""

from __future__ import annotations

from math import degrees
from typing import Any

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import by_value
from aerobat.engines.pytree import components
from aerobat.kernels.gates.pointing import Direction, Pointing
from aerobat.simulation.outcome import FlightFailure, Outcome
from aerobat.simulation.passages.passage import PASSAGE_WINDOW, PerFlight


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


def stage_attitudes(planned: PlannedAttitude, found: Pointing, stop: Array) -> StageAttitude:
    """Return the attitudes of many flights at one stage.

    Args:
        planned: the planned attitude.
        found: of the vehicles, leaves (flights,).
        stop: when flights diverged [s], NaN for those that did not, (flights,).
    """
    came = np.isfinite(found.time)
    angle = np.degrees(np.arccos(np.clip(found.cosine, -1.0, 1.0)))
    numbers: dict[str, Any] = {
        "time": np.where(came, found.time, np.nan),
        "angle_deg": np.where(came, angle, np.nan),
        "planned": np.where(came | ~(stop <= planned.time), planned.time, np.nan),
    }
    return StageAttitude(planned.stage, planned.lap, degrees(planned.tolerance), **numbers)


def attitude_direction(planned: PlannedAttitude) -> Direction:
    """Return a planned attitude as kernels read it, leaves numbers."""
    return Direction(components(planned.up), planned.time, PASSAGE_WINDOW)
