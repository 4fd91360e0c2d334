"""Limits that a flight shall stay within, beside those of the rotors."""

from __future__ import annotations

import numpy as np

from aerobat.declaration import Count, Label, Limit, NonNegative, Number, TiltLimit, UnitVector, declared
from aerobat.problem import Ball, Condition, EndState, Gate, Limits, Quantity, Stage
from aerobat.problem.stage import PARALLEL

CROSSING_SPEED = 1e-3  # [m/s] a path that is slower in the gate's plane does not cross it
PASSAGE_DEPTH = 0.05  # [m] beyond the plane, where who crosses it has not merely stopped in it
NO_LIMITS = Limits()


@declared
class PlannedPassage:
    """A gate to be passed at an instant: its plane crossed in its direction, inside its opening."""

    gate: Gate
    time: NonNegative  # [s]
    up: UnitVector  # where the thrust axis shall point
    attitude_tolerance: Number = np.inf  # [rad] between them, at most; infinite where no attitude is asked
    min_speed: NonNegative = CROSSING_SPEED  # [m/s] in the gate's direction; 0 where it may be met along it
    margin: NonNegative = 0.0  # [m] from the edges of its opening
    lap: Count = 1  # of a course

    @classmethod
    def of(cls, stage: Stage, gate: Gate, time: float) -> PlannedPassage:
        """The passage that a stage of `Problem.stages` asks for, placed at a time [s]."""
        min_speed = 0.0 if any(_keeps_from(gate, each) for each in stage.conditions) else CROSSING_SPEED
        if stage.attitude is None:
            return cls(gate, time, gate.up, min_speed=min_speed, margin=stage.margin, lap=stage.lap)
        asked = stage.attitude.up, gate.attitude_tolerance
        return cls(gate, time, *asked, min_speed, stage.margin, stage.lap)


@declared
class PlannedWaypoint:
    """A ball to be met at an instant."""

    name: Label
    ball: Ball
    time: NonNegative  # [s]
    lap: Count = 1  # of a course


def _keeps_from(gate: Gate, condition: Condition) -> bool:
    """True if a condition forbids to move in the gate's direction."""
    along = float(condition.direction @ gate.normal)
    forward = condition.upper if along > 0 else -condition.lower
    return condition.quantity is Quantity.VELOCITY and abs(along) > PARALLEL and forward <= 0


@declared
class Envelope:
    """Limits over continuous time; infinite where there is none.

    `limits` bounds position and its derivatives per axis, as a problem does; `conditions` hold throughout,
    `passages` and `waypoints` at their instants, `start` and `goal` where the path begins and ends. What is
    `closed` goes on from its end as from its start.
    """

    speed: Limit = np.inf  # [m/s] |v|
    tilt: TiltLimit = np.inf  # [rad] between the thrust axis and the vertical; beyond pi it limits nothing
    body_rate: Limit = np.inf  # [rad/s] |ω|
    moment: Limit = np.inf  # [N·m] |M|
    limits: Limits = NO_LIMITS
    conditions: tuple[Condition, ...] = ()
    passages: tuple[PlannedPassage, ...] = ()
    waypoints: tuple[PlannedWaypoint, ...] = ()
    start: EndState | None = None
    goal: EndState | None = None
    closed: bool = False
