"""The number of times that a path turns the vehicle over, beside what its stages ask."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from aerobat.planning.courses import is_course
from aerobat.problem.condition import ForceBalance, Quantity
from aerobat.problem.stage import Stage, StageSequence
from aerobat.trajectory import Trajectory

TURN_PRICE = 0.2  # fraction of the duration that each extra turn adds when paths are compared
UPSIDE_DOWN = -0.5  # vertical thrust direction below which a body is upside down: a tilt of 120° or more
PLACES = np.linspace(0.0, 1.0, 64, endpoint=False)  # fractions of a segment at which the thrust is sampled


def priced_duration(trajectory: Trajectory, stages: StageSequence, balance: ForceBalance) -> float:
    """Return a path's duration [s], increased by the fraction TURN_PRICE for each extra turn."""
    return trajectory.duration * (1.0 + TURN_PRICE * extra_turns(trajectory, stages, balance))


def extra_turns(trajectory: Trajectory, stages: StageSequence, balance: ForceBalance) -> int:
    """Return how many times a path turns the vehicle upside down beyond what its stages ask.

    The number is zero where no stage asks for a turn, and on courses with positions, where turns can save
    time.
    """
    inverted = [False, *map(_asks_upside_down, stages.stages)]
    turns = sum(after and not before for before, after in pairwise(inverted))
    if not turns or (is_course(stages) and any(stage.is_placed for stage in stages.stages)):
        return 0
    velocity, acceleration = (trajectory.on_segments(PLACES, derivative) for derivative in (1, 2))
    thrust = balance.specific_thrust(velocity, acceleration).reshape(-1, 3)
    upward = thrust[:, 2] / np.linalg.norm(thrust, axis=1)
    sides = upward[(upward < UPSIDE_DOWN) | (upward > 0.0)] < 0.0  # hysteresis: samples between are ignored
    return max(int((sides[1:] & ~sides[:-1]).sum()) - turns, 0)


def _asks_upside_down(stage: Stage) -> bool:
    """Return whether a stage asks for downward thrust."""
    return any(
        condition.quantity is Quantity.SPECIFIC_THRUST
        and condition.lower > 0.0
        and condition.direction[2] < UPSIDE_DOWN * float(np.linalg.norm(condition.direction))
        for condition in stage.conditions
    )
