"""The ends of a motion: given states, between which it is as fast as it can be."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.problem.end_state import EndState
from aerobat.so3 import UP
from collocation.optimal_control.collocation import CollocatedMotion, CollocationMesh
from collocation.optimal_control.elements import Elements
from collocation.optimal_control.rows import Rows
from collocation.optimal_control.zero_yaw_rate_body import (
    ATTITUDE,
    INPUTS,
    POSITION,
    RATES,
    VELOCITY,
)

END_SHARE = 0.5  # of the thrust that either end asks: a floor of thrust may be no higher
ALONG_Z = (0.0, 0.0, 0.0), (0.0, 0.0, inf)  # bounds on a thrust direction in body axes


@dataclass(frozen=True, eq=False)
class End:
    """State fixed at one end of the motion; body rates are zero there unless its attitude is free."""

    position: Array  # [m], (3,)
    velocity: Array  # [m/s], (3,)
    thrust: Array  # f = a + g e3 + (d/m) w [m/s²], along the thrust axis, (3,)
    free_attitude: bool = False  # thrust and body rates are not fixed
    free_velocity: bool = False  # likewise the velocity

    @classmethod
    def of(cls, state: EndState, elements: Elements) -> End:
        """A problem's, drag counted."""
        thrust = elements.task.balance.specific_thrust(state.velocity, state.acceleration)
        return cls(state.position, state.velocity, thrust, state.leaves_attitude_free, state.free_velocity)

    @property
    def inputs(self) -> tuple[float, float, float]:
        """The inputs there: the specific thrust, and no angular acceleration."""
        return float(np.linalg.norm(self.thrust)), 0.0, 0.0


@dataclass(frozen=True, eq=False)
class FixedEnds:
    """A start and a goal in given states."""

    elements: Elements

    @cached_property
    def start(self) -> End:
        """The end at which the motion begins."""
        return End.of(self.elements.task.problem.start, self.elements)

    @cached_property
    def goal(self) -> End:
        """The end at which the motion ends."""
        return End.of(self.elements.task.problem.goal, self.elements)

    def fix(self, motion: CollocatedMotion, continuous: bool) -> None:
        """Write states, the start's attitude, thrusts, and with lag moments into a bound on all unknowns."""
        for node, end in ((0, self.start), (-1, self.goal)):
            motion.states[POSITION, node] = end.position
            if not end.free_velocity:
                motion.states[VELOCITY, node] = end.velocity
            if not end.free_attitude:
                motion.states[RATES, node] = 0.0
        upright = so3.smallest_rotation(UP, self.start.thrust / np.linalg.norm(self.start.thrust))
        heading = so3.about_axis(UP, np.array(self.elements.task.problem.heading.start))
        motion.states[ATTITUDE, 0] = so3.multiply(upright, heading)
        fixed = INPUTS if continuous else 1
        motion.starts[:fixed, 0] = self.start.inputs[:fixed]
        if not self.goal.free_attitude:
            motion.ends[:fixed, -1] = self.goal.inputs[:fixed]

    def hold(self, rows: Rows, mesh: CollocationMesh) -> None:
        """Add that the thrust points where the goal says."""
        if not self.goal.free_attitude:
            rows.hold(self.elements.goal_thrust, mesh.states[-1:], *ALONG_Z, self.goal.thrust)

    def thrust_floor(self, floor: float) -> float:
        """The specific thrust [m/s²] that may be asked all along: a floor, or less where an end has less."""
        at_ends = min(float(np.linalg.norm(end.thrust)) for end in (self.start, self.goal))
        return min(floor, END_SHARE * at_ends)
