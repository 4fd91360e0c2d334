"""Boundaries of a motion: ends in given states, or a lap that ends in the state in which it begins."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from math import cos, inf, sin
from typing import Protocol

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.flatness import reference
from aerobat.kernels.quaternions import conjugate, multiply
from aerobat.optimization.nonlinear import components, import_casadi
from aerobat.optimization.separable import ElementFunction
from aerobat.planning.time_optimal.optimal_control.collocation import (
    STATE_SCALE,
    CollocatedMotion,
    CollocationMesh,
)
from aerobat.planning.time_optimal.optimal_control.elements import Elements, weighted_sum
from aerobat.planning.time_optimal.optimal_control.rows import Rows
from aerobat.planning.time_optimal.optimal_control.zero_yaw_rate_body import (
    ATTITUDE,
    INPUTS,
    POSITION,
    RATES,
    STATES,
    VELOCITY,
)
from aerobat.problem.end_state import EndState
from aerobat.so3 import UP
from aerobat.trajectory import Trajectory

END_SHARE = 0.5  # of the thrust that either end asks: a floor of thrust may be no higher
ALONG_Z = (0.0, 0.0, 0.0), (0.0, 0.0, inf)  # bounds on a thrust direction in body axes
NEGLIGIBLE_TWIST = 1e-8  # [rad] about half of it
SECONDS = 0.1  # [s] that scales the slope of the thrust, beside its own scale


class Boundary(Protocol):
    """The constraints that hold where a motion begins and ends."""

    @property
    def is_closed(self) -> bool:
        """True where the end is the start."""
        ...

    def fix(self, motion: CollocatedMotion, continuous: bool) -> None:
        """Write the numbers that are fixed into a bound on all unknowns."""
        ...

    def hold(self, rows: Rows, mesh: CollocationMesh) -> None:
        """Add the constraints."""
        ...

    def thrust_floor(self, floor: float) -> float:
        """The least specific thrust [m/s²] that may be asked all along, where so much is wanted."""
        ...

    def corrected(self, trajectory: Trajectory) -> Boundary:
        """The same but for what a solution's trajectory misses of it; itself where that misses nothing."""
        ...


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
    is_closed: bool = field(default=False, init=False)

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
        heading = so3.about_axis(UP, np.array(self.elements.task.problem.heading))
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
        """The floor, or less where an end asks less."""
        at_ends = min(float(np.linalg.norm(end.thrust)) for end in (self.start, self.goal))
        return min(floor, END_SHARE * at_ends)

    def corrected(self, trajectory: Trajectory) -> FixedEnds:
        """Return the boundary itself: given ends need no correction."""
        return self


@dataclass(frozen=True, eq=False)
class ClosedLap:
    """An end that is the start: state, inputs, and the slope of the thrust, so that jerk is the same too.

    That leaves two things open. The start is put half-way in time between the last stage and the first, as
    any other instant of the same lap would do; and the body there is turned about its thrust axis by the
    problem's heading.
    """

    elements: Elements
    twist: float = 0.0  # [-] of the quaternion from start to end, z: what its collocation makes of none
    is_closed: bool = field(default=True, init=False)

    def fix(self, motion: CollocatedMotion, continuous: bool) -> None:
        """Write nothing: all is free."""

    def hold(self, rows: Rows, mesh: CollocationMesh) -> None:
        """Add that the end is the start, and where on the lap that is."""
        first = np.concatenate([mesh.states[0], mesh.inputs[0, 0]])
        last = np.concatenate([mesh.states[-1], mesh.inputs[1, -1]])
        apart = np.zeros(STATES - 1 + INPUTS)
        apart[ATTITUDE.start + 2] = self.twist
        rows.hold(self._apart, np.concatenate([first, last])[None], apart, apart)
        ends = [[0, *mesh.inputs[:, 0, 0]], [len(mesh.intervals) - 1, *mesh.inputs[:, -1, 0]]]
        fractions = mesh.fractions[[0, -1]]
        rows.hold(self._slope_apart, np.concatenate(ends)[None], 0.0, 0.0, fractions)
        rows.hold(self._upright_start, mesh.states[:1], [[1.0, 0.0]], [[1.0, 0.0]])
        outer = np.array([[0, len(mesh.intervals) - 1]])
        rows.hold(weighted_sum(2), outer, 0.0, 0.0, (1.0, -1.0))

    def thrust_floor(self, floor: float) -> float:
        """The floor."""
        return floor

    def corrected(self, trajectory: Trajectory) -> ClosedLap:
        """The lap without the twist that errors of its attitudes' collocation add up to."""
        times = [0.0, trajectory.duration]
        task = self.elements.task
        flown = reference(trajectory, task.vehicle, times, environment=task.environment)
        first, last = flown.setpoint.q_world_body
        missed = float(so3.multiply(so3.conjugate(first), last)[3])
        return self if abs(missed) <= NEGLIGIBLE_TWIST else replace(self, twist=self.twist - missed)

    @cached_property
    def _apart(self) -> ElementFunction:
        """How far one scaled state with its inputs is from another: of attitudes the turn between them."""
        ca = import_casadi()
        z = ca.SX.sym("z", 2 * (STATES + INPUTS))
        first, last = z[: STATES + INPUTS], z[STATES + INPUTS :]
        apart = last - first
        turn = multiply(conjugate(components(first[ATTITUDE])), components(last[ATTITUDE]))[1:]
        values = ca.vertcat(apart[: ATTITUDE.start], *turn, apart[ATTITUDE.stop :])
        return ElementFunction(ca.Function("apart", [z, ca.SX.sym("none", 0)], [values]))

    @cached_property
    def _slope_apart(self) -> ElementFunction:
        """How far the thrust's slope in the last interval is from that in the first, scaled.

        Of the duration of the phase and the scaled thrusts at both ends of the interval, of first and last;
        the parameters are the intervals' parts of their phases.
        """
        ca = import_casadi()
        z, fractions = ca.SX.sym("z", 6), ca.SX.sym("fractions", 2)
        slopes = [(z[3 * i + 2] - z[3 * i + 1]) / (z[3 * i] * fractions[i]) for i in (0, 1)]
        return ElementFunction(ca.Function("slope", [z, fractions], [SECONDS * (slopes[1] - slopes[0])]))

    @cached_property
    def _upright_start(self) -> ElementFunction:
        """The squared norm of a state's quaternion, and zero where it turns by the heading about its axis."""
        ca, half = import_casadi(), self.elements.task.problem.heading / 2.0
        z = ca.SX.sym("z", STATES)
        q = z[ATTITUDE] * STATE_SCALE[ATTITUDE]
        turned = cos(half) * q[3] - sin(half) * q[0]
        values = ca.vertcat(ca.sumsqr(q), turned)
        return ElementFunction(ca.Function("start", [z, ca.SX.sym("none", 0)], [values]))
