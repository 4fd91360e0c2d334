"""Gates and waypoints at planned instants, by which certificate and flights are judged."""

from __future__ import annotations

import numpy as np

from aerobat.declaration import Count, Label, NonNegative, Number, UnitVector, declared
from aerobat.problem.ball import Ball
from aerobat.problem.condition import Condition, Quantity
from aerobat.problem.gate import Gate
from aerobat.problem.stage import PARALLEL, Stage

CROSSING_SPEED = 1e-3  # [m/s] a slower path moves in the gate's plane and does not cross it
PASSAGE_DEPTH = 0.05  # [m] beyond the plane, from which a vehicle has crossed and not merely stopped in it


@declared
class PlannedPassage:
    """A gate to be passed at an instant: its plane crossed in its direction, inside its opening."""

    gate: Gate
    time: NonNegative  # [s]
    up: UnitVector  # required direction of the thrust axis
    attitude_tolerance: Number = np.inf  # [rad] largest angle of thrust axis and `up`; infinite: any attitude
    min_speed: NonNegative = CROSSING_SPEED  # [m/s] in the gate's direction; 0: any motion is allowed
    margin: NonNegative = 0.0  # [m] from the edges of its opening
    lap: Count = 1  # of a course

    @classmethod
    def of(cls, stage: Stage, gate: Gate, time: float) -> PlannedPassage:
        """Return the passage that a stage of `Problem.stages` requires, placed at a time [s]."""
        min_speed = 0.0 if any(_forbids_passage(gate, each) for each in stage.conditions) else CROSSING_SPEED
        up, tolerance = gate.up, np.inf
        if stage.attitude is not None:
            up, tolerance = stage.attitude.up, gate.attitude_tolerance
        return cls(gate, time, up, tolerance, min_speed, stage.margin, stage.lap)


@declared
class PlannedWaypoint:
    """A ball to be met at an instant."""

    name: Label
    ball: Ball
    time: NonNegative  # [s]
    lap: Count = 1  # of a course


def _forbids_passage(gate: Gate, condition: Condition) -> bool:
    """Return True if a condition forbids motion in the gate's direction."""
    along = float(condition.direction @ gate.normal)
    forward = condition.upper if along > 0 else -condition.lower
    return condition.quantity is Quantity.VELOCITY and abs(along) > PARALLEL and forward <= 0
