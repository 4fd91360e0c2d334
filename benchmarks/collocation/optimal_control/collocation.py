"""Two-point Hermite collocation: a motion of the rigid body as unknowns, equations, and a trajectory.

Time is cut into phases and phases into intervals; the input is linear on each interval. At both ends of an
interval the equations of motion give x', x'', x''' exactly. The integral of the quintic through these must
lead from one state to the next, a rule of order six:

    x₁ = x₀ + h/2 (x₀' + x₁') + h²/10 (x₀'' − x₁'') + h³/120 (x₀''' + x₁''').

For the position, whose acceleration is such a quintic, the integral is taken twice. A solution therefore
*is* a piecewise polynomial of degree seven, with the rigid body's thrust direction, body rates, moments and
collective thrust at both ends of every interval: nothing is interpolated between the program and what is
flown.

All this is a sum of what either side of an interval contributes, of its own state and of the input.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from aerobat import so3
from aerobat.arrays import Array, Indices
from aerobat.flatness import has_unequal_drag, reference
from aerobat.trajectory import Trajectory, polynomial
from collocation.nonlinear import import_casadi
from collocation.optimal_control.zero_yaw_rate_body import (
    INPUTS,
    POSITION,
    RATES,
    STATES,
    VELOCITY,
    ZeroYawRateBody,
)

STATE_SCALE = np.repeat([1.0, 5.0, 1.0, 5.0], [3, 3, 4, 2])  # what is large in SI units
QUINTIC = polynomial.hermite(np.eye(6)[:3], np.eye(6)[3:])  # powers of y (rows) from y, y', y'' at both ends
INTEGRAL = 1.0 / np.arange(1, 7)  # of each power over [0, 1]
DOUBLE_INTEGRAL = INTEGRAL / np.arange(2, 8)
TURNING_WEIGHT = 0.2  # of where a mesh's intervals lie: the change of body rates, the rest time
BESIDE = 0.7  # times its angular acceleration, that an interval beside another is refined by
SHORT_END = 0.5  # times the length of others: 1 costs section-v 2.5 %, 0.2 leads it to poor local optima
BOUNDED_DERIVATIVES = 5  # position to snap, that limits can bound


@dataclass(frozen=True, eq=False)
class CollocatedMotion:
    """States and inputs over all phases in SI units."""

    phases: Array  # durations [s], (P,)
    states: Array  # at the nodes, (12, K + 1)
    starts: Array  # inputs at the starts of the intervals, (3, K)
    ends: Array  # and at their ends, (3, K)


@dataclass(frozen=True, eq=False)
class CollocationMesh:
    """Phases cut into intervals, and where a motion on them stands in one column of scaled unknowns.

    The input of a `continuous` motion is the same on both sides of every inner node.
    """

    intervals: tuple[int, ...]  # of each phase, (P,)
    fractions: Array  # part of its phase that each interval takes, (K,)
    continuous: bool
    input_scale: Array  # what is large for an input, (3,)

    @classmethod
    def even(cls, intervals: tuple[int, ...], continuous: bool, input_scale: Array) -> CollocationMesh:
        """Phases cut into so many equal intervals each, but for the two at the ends where the input jumps."""
        mesh = cls(intervals, np.repeat(1.0 / np.array(intervals), intervals), continuous, input_scale)
        return mesh if continuous else mesh.with_short_ends

    def refined(self, motion: CollocatedMotion, intervals: int, minimum: int) -> CollocationMesh:
        """A mesh of about so many intervals that are shorter where a motion on this one turns its body.

        Their boundaries cut a weight into equal parts: time, and the change of the body rates by it, which
        jump within a few milliseconds in fast motions.

        Args:
            motion: On this mesh.
            intervals: In all, shared among phases by their weights.
            minimum: Of each phase.
        """
        durations = self.durations(motion.phases)
        turning = np.linalg.norm(motion.starts[1:] + motion.ends[1:], axis=0) / 2.0
        beside = np.pad(turning, 1)  # a jump may come to lie in an interval beside it
        turning = np.maximum(turning, BESIDE * np.maximum(beside[:-2], beside[2:]))
        change = turning * durations
        weights = (
            1.0 - TURNING_WEIGHT
        ) * durations / durations.sum() + TURNING_WEIGHT * change / change.sum()
        counts, fractions = [], []
        for phase in range(len(self.intervals)):
            inside = self.phase_of == phase
            counts.append(max(minimum, round(intervals * float(weights[inside].sum()))))
            passed, times = (np.append(0.0, np.cumsum(x[inside])) for x in (weights, self.fractions))
            boundaries = np.interp(np.linspace(0.0, passed[-1], counts[-1] + 1), passed, times)
            fractions.append(np.diff(boundaries) / times[-1])
        mesh = CollocationMesh(tuple(counts), np.concatenate(fractions), self.continuous, self.input_scale)
        return mesh if self.continuous else mesh.with_short_ends

    @property
    def with_short_ends(self) -> CollocationMesh:
        """The mesh with short intervals at its ends, where thrust without lag leaves what is fixed there."""
        fractions = self.fractions.copy()
        fractions[[0, -1]] *= SHORT_END
        return replace(self, fractions=fractions / np.bincount(self.phase_of, fractions)[self.phase_of])

    @property
    def total(self) -> int:
        """K, the intervals of all phases."""
        return sum(self.intervals)

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return len(self.scale)

    @cached_property
    def phase_of(self) -> Indices:
        """The phase of each interval, which is the place of its duration too, (K,)."""
        return np.repeat(np.arange(len(self.intervals)), self.intervals)

    @cached_property
    def states(self) -> Indices:
        """Places of the states at the nodes, (K + 1, 12)."""
        return len(self.intervals) + np.arange(STATES * (self.total + 1)).reshape(-1, STATES)

    @cached_property
    def inputs(self) -> Indices:
        """Places of the inputs at the starts and at the ends of the intervals, (2, K, 3)."""
        count = self.total + 1 if self.continuous else 2 * self.total
        places = self.states.max() + 1 + np.arange(INPUTS * count).reshape(-1, INPUTS)
        return np.stack([places[: self.total], places[-self.total :]])

    @cached_property
    def scale(self) -> Array:
        """Scale of each unknown, in SI units, (size,)."""
        inputs = (self.inputs.max() + 1 - self.inputs.min()) // INPUTS
        states = np.tile(STATE_SCALE, self.total + 1)
        return np.concatenate([np.ones(len(self.intervals)), states, np.tile(self.input_scale, inputs)])

    @cached_property
    def leg_of_unknowns(self) -> Indices:
        """The phase of each unknown, of those at a boundary the earlier one, (size,)."""
        legs = np.empty(self.size, dtype=int)
        legs[: len(self.intervals)] = np.arange(len(self.intervals))
        legs[self.states[0]] = 0
        legs[self.states[1:]] = self.phase_of[:, None]
        legs[self.inputs] = self.phase_of[:, None]
        return legs

    def side_unknowns(self, last: int) -> Indices:
        """Places of what a side of each interval depends on: duration, its state, both inputs, (K, 19)."""
        states = self.states[1:] if last else self.states[:-1]
        return np.hstack([self.phase_of[:, None], states, *self.inputs])

    def durations(self, phases: Array) -> Array:
        """Of the intervals [s], (K,)."""
        return phases[self.phase_of] * self.fractions

    def pack(self, motion: CollocatedMotion) -> Array:
        """The column of unknowns of a motion, (size,)."""
        column = np.empty(self.size)
        column[: len(self.intervals)] = motion.phases
        column[self.states] = motion.states.T
        column[self.inputs[1]] = motion.ends.T
        column[self.inputs[0]] = motion.starts.T
        return column / self.scale

    def read(self, column: Array) -> CollocatedMotion:
        """The motion of a column of unknowns."""
        si = column * self.scale
        starts, ends = si[self.inputs]
        return CollocatedMotion(si[: len(self.intervals)], si[self.states].T, starts.T, ends.T)


class IntervalSide:
    """One side of an interval in CasADi's symbols SX: what it contributes to the interval's quintic."""

    def __init__(self, body: ZeroYawRateBody, input_scale: Array, last: int) -> None:
        sx = import_casadi().SX
        # scaled, as `CollocationMesh.side_unknowns` orders them
        self.unknowns = sx.sym("z", 1 + STATES + 2 * INPUTS)
        self.fraction = sx.sym("fraction")
        self.last = last
        z = self.unknowns * np.concatenate([[1.0], STATE_SCALE, input_scale, input_scale])
        self.duration = z[0] * self.fraction
        self.state = z[1 : 1 + STATES]
        start, end = z[1 + STATES : 1 + STATES + INPUTS], z[1 + STATES + INPUTS :]
        self.input = end if last else start
        self.slope = (end - start) / self.duration
        self.rates = body.derivatives(self.state, self.input, self.slope)

    def defect(self) -> Any:
        """Return the side's part of the defect by which the quintics miss the next state, (12,)."""
        h, ca = self.duration, import_casadi()
        signed = self.state if self.last else -self.state
        missed = signed - h * self._combined(INTEGRAL)
        fallen = h**2 * self._combined(DOUBLE_INTEGRAL)[VELOCITY]
        position = signed[POSITION] - fallen
        if not self.last:
            position -= h * self.state[VELOCITY]
        return ca.vertcat(position, missed[VELOCITY.start :])

    def here(self) -> list[Any]:
        """Position to snap at this side, (3,) each."""
        return [self.state[POSITION], self.state[VELOCITY], *(rate[VELOCITY] for rate in self.rates)]

    def between(self, s: float) -> list[Any]:
        """Return the side's part of position to snap at a fraction s of the interval, (3,) each."""
        h, powers = self.duration, np.vander([s], 6, increasing=True)[0]
        parts = [
            h**2 * self._combined(DOUBLE_INTEGRAL * powers * s**2)[VELOCITY],
            h * self._combined(INTEGRAL * powers * s)[VELOCITY],
        ]
        for derivative in range(3):
            basis = polynomial.differentiate(np.eye(6)[..., None], derivative)[..., 0]
            slopes = basis @ powers[: basis.shape[1]]
            parts.append(self._combined(slopes)[VELOCITY] / h**derivative)
        if not self.last:
            parts[0] += self.state[POSITION] + s * h * self.state[VELOCITY]
            parts[1] += self.state[VELOCITY]
        return parts

    def body_rate(self, s: float) -> Any:
        """ω_x and ω_y at a fraction s of the interval, from its first side, (2,)."""
        turning, change = self.input[1:], self.slope[1:] * self.duration
        return self.state[RATES] + self.duration * (s * turning + s**2 / 2.0 * change)

    def _combined(self, weights: Array) -> Any:
        """Weighted sum of the powers of the quintic, of this side's part of it."""
        columns = (weights @ QUINTIC)[3:] if self.last else (weights @ QUINTIC)[:3]
        return sum(
            w * self.duration**k * rate
            for k, (w, rate) in enumerate(zip(columns.tolist(), self.rates, strict=True))
        )


def trajectory_of(
    body: ZeroYawRateBody, mesh: CollocationMesh, motion: CollocatedMotion, heading: float
) -> Trajectory:
    """The trajectory of a motion, from its start on, continuous to the last digit.

    Args:
        body: The equations of motion.
        mesh: Where the motion has its nodes.
        motion: States and inputs there.
        heading: Of the trajectory [rad].
    """
    durations = mesh.durations(motion.phases)
    slope = (motion.ends - motion.starts) / durations
    columns = body.derivatives.map(mesh.total)
    sides = (motion.states[:, :-1], motion.starts), (motion.states[:, 1:], motion.ends)
    ends = [
        rate.full()[VELOCITY] * durations**k
        for state, u in sides
        for k, rate in enumerate(columns(state, u, slope))
    ]
    trajectory = _integrated(motion, durations, ends, heading)
    if has_unequal_drag(body.vehicle):
        _join_body_rates(body, trajectory, ends)
        trajectory = _integrated(motion, durations, ends, heading)
    return trajectory


def _join_body_rates(body: ZeroYawRateBody, trajectory: Trajectory, ends: list[Array]) -> None:
    """Leave of the jumps of jerk between intervals what is along the thrust: only there may it jump.

    With unequal drag the thrust axis depends on the body's angle about it, which the path's own attitude and
    the motion's, of which the jumps are, have in common but for the error of collocation.

    Args:
        body: The equations of motion.
        trajectory: What `ends` make.
        ends: Acceleration, jerk and snap at both ends of intervals, times powers of durations, (3, K).
    """
    found = reference(trajectory, body.vehicle, trajectory.knots, environment=body.environment)
    b3 = so3.thrust_axis(found.setpoint.q_world_body[1:-1]).T
    before, after = ends[4][:, :-1], ends[1][:, 1:]
    jump = after / trajectory.durations[1:] - before / trajectory.durations[:-1]
    across = jump - b3 * np.sum(b3 * jump, axis=0)
    before += across / 2 * trajectory.durations[:-1]
    after -= across / 2 * trajectory.durations[1:]


def _integrated(motion: CollocatedMotion, durations: Array, ends: list[Array], heading: float) -> Trajectory:
    """The trajectory with these accelerations, jerks and snaps at the ends of intervals."""
    quintics = np.einsum("ij,jdk->kid", QUINTIC, ends) * durations[:, None, None] ** 2
    twice = (np.arange(1, 7) * np.arange(2, 8))[:, None]
    coefficients = np.concatenate([np.zeros((len(durations), 2, 3)), quintics / twice], axis=1)
    position, velocity = motion.states[POSITION, 0], motion.states[VELOCITY, 0]
    for piece, h in zip(coefficients, durations.tolist(), strict=True):
        piece[:2] = position, h * velocity
        position, velocity = piece.sum(axis=0), np.arange(8) @ piece / h
    return Trajectory(durations, coefficients, heading)
