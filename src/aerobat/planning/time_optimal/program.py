"""The fastest motion of a rigid body as a nonlinear program: ends, stages, limits, rotors that bear it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from math import inf
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from aerobat.arrays import Array
from aerobat.environment import Environment
from aerobat.optimization.nonlinear import NonlinearProgram, import_casadi
from aerobat.planning.time_optimal.collocation import CollocatedMotion, Collocation, Mesh
from aerobat.planning.time_optimal.zero_yaw_rate_body import (
    ATTITUDE,
    INPUTS,
    POSITION,
    RATES,
    STATES,
    VELOCITY,
    ZeroYawRateBody,
)
from aerobat.problem.condition import Condition, ForceBalance
from aerobat.problem.problem import Limits
from aerobat.vehicle import Vehicle

SHORTEST_PHASE = 1e-3  # [s]
# [s] for one change of an input by half its range in each interval: far below what is reported, it settles
# what the duration leaves open
CHANGE_COST = 1e-4
BOUNDED_DERIVATIVES = 5  # position to snap, that limits can bound
KINEMATIC = (POSITION, VELOCITY)
ALONG_Z = np.zeros(3), np.array([0.0, 0.0, inf])  # bounds on a thrust direction in body axes


@dataclass(frozen=True, eq=False)
class End:
    """State fixed at one end of the motion; body rates are zero there."""

    position: Array  # [m], (3,)
    velocity: Array  # [m/s], (3,)
    thrust: Array  # a + g e3 + (d/m) v [m/s²], the direction of the thrust axis, (3,)
    collective: float  # [N] that this takes


@dataclass(frozen=True, eq=False)
class NodeBounds:
    """Bounds at every node: limits, and the range of the rotors' thrusts or, where they lag, commands."""

    lower: Array  # [N], (n,)
    upper: Array  # [N], (n,)
    min_collective: float  # [N] of all together, which keeps the attitude determined
    limits: Limits


@dataclass(frozen=True, eq=False)
class OptimalControl:
    """The fastest motion from `start` to `goal`; `stages` hold where one phase ends and the next begins.

    Without rotor lag the input may jump at every node. With it the motion is what lagging rotors can follow:
    their thrusts are continuous, from those that go with one end's acceleration to those of the other.
    """

    vehicle: Vehicle
    environment: Environment
    intervals: tuple[int, ...]  # of each phase, (P,)
    start: End
    q_start: Array  # (4,)
    goal: End
    stages: tuple[tuple[Condition, ...], ...]  # (P - 1,)
    path_constraints: tuple[Condition, ...]

    @cached_property
    def body(self) -> ZeroYawRateBody:
        """The equations of motion."""
        return ZeroYawRateBody(self.vehicle, self.environment)

    @cached_property
    def mesh(self) -> Mesh:
        """The unknowns."""
        vehicle = self.vehicle
        spread = np.abs(vehicle.allocation[:INPUTS]) @ (vehicle.max_thrusts - vehicle.min_thrusts) / 2
        scale = spread / np.array([1.0, vehicle.inertia[0, 0], vehicle.inertia[1, 1]])
        return Mesh(self.intervals, bool(vehicle.lags.any()), scale)

    def of(self, motion: CollocatedMotion) -> Collocation:
        """A motion with its rates and rotor thrusts."""
        return Collocation(self.body, self.mesh, motion)

    def program(self, bounds: NodeBounds) -> NonlinearProgram:
        """The program of the mesh's unknowns."""
        column = import_casadi().MX.sym("motion", self.mesh.size)
        collocation = self.of(self.mesh.unpack(column))
        rows = _Rows()
        rows.hold(collocation.defects(), 0.0, 0.0)
        self._hold_rotors(rows, collocation, bounds)
        rows.hold(self.body.thrust_axes(collocation.motion.states[:, -1]).T @ self.goal.thrust, *ALONG_Z)
        self._hold_stages(rows, collocation)
        self._hold_limits(rows, collocation, bounds.limits)
        lower, upper = (self.mesh.pack(motion) for motion in self._box(bounds.min_collective))
        return NonlinearProgram(column, self._cost(collocation.motion), *rows.stacked(), lower, upper)

    def _hold_rotors(self, rows: _Rows, collocation: Collocation, bounds: NodeBounds) -> None:
        """A rotor that lags stays within its limits if its commands do."""
        for thrusts, commands in collocation.rotors:
            rows.hold(commands if self.mesh.continuous else thrusts, bounds.lower, bounds.upper)

    def _hold_stages(self, rows: _Rows, collocation: Collocation) -> None:
        for node, conditions in zip(np.cumsum(self.intervals).tolist(), self.stages, strict=False):
            for condition in conditions:
                for values in self._around(collocation, condition.quantity.derivative, node):
                    self._hold(rows, condition, values)

    def _hold_limits(self, rows: _Rows, collocation: Collocation, limits: Limits) -> None:
        for derivative in range(BOUNDED_DERIVATIVES):
            lower, upper = limits.of(derivative)
            for axis in np.flatnonzero(np.isfinite(lower) | np.isfinite(upper)).tolist():
                for values in self._everywhere(collocation, derivative):
                    rows.hold(values[axis, :], lower[axis], upper[axis])
        for condition in self.path_constraints:
            for values in self._everywhere(collocation, condition.quantity.derivative):
                self._hold(rows, condition, values)

    def _hold(self, rows: _Rows, condition: Condition, values: Any) -> None:
        """A condition on values (3, m) of its derivative."""
        along = import_casadi().DM(condition.direction).T @ values
        bound = condition.bound(ForceBalance(self.environment.gravity))
        rows.hold(along, *bound.limits)

    def _around(self, collocation: Collocation, derivative: int, node: int) -> Iterator[Any]:
        """A derivative up to acceleration at an inner node, (3, 1); on both sides where it may jump."""
        if derivative < 2:
            yield collocation.motion.states[KINEMATIC[derivative], node]
            return
        yield collocation.rates.starts[0][VELOCITY, node]
        if not self.mesh.continuous:
            yield collocation.rates.ends[0][VELOCITY, node - 1]

    def _everywhere(self, collocation: Collocation, derivative: int) -> Iterator[Any]:
        """A derivative up to snap wherever it is not fixed, (3, m) each; on both sides where it may jump."""
        rates = collocation.rates
        if derivative < 2:
            yield collocation.motion.states[KINEMATIC[derivative], 1:-1]
        elif derivative == 2 and self.mesh.continuous:
            yield rates.starts[0][VELOCITY, 1:]
        else:
            yield rates.starts[derivative - 2][VELOCITY, :]
            yield rates.ends[derivative - 2][VELOCITY, :]
        if derivative >= 2:
            yield from collocation.between(derivative)

    def _box(self, min_collective: float) -> tuple[CollocatedMotion, CollocatedMotion]:
        """The least and the most that every unknown may be: what is fixed, and little else."""
        lower, upper = self._all(-inf), self._all(inf)
        lower.phases[:] = SHORTEST_PHASE
        lower.starts[0] = lower.ends[0] = min_collective
        for motion in (lower, upper):
            self._fix_ends(motion)
        return lower, upper

    def _all(self, value: float) -> CollocatedMotion:
        """A motion whose every number is the same."""
        total = self.mesh.total
        shapes = ((len(self.intervals),), (STATES, total + 1), (INPUTS, total), (INPUTS, total))
        return CollocatedMotion(*(np.full(shape, value) for shape in shapes))

    def _fix_ends(self, motion: CollocatedMotion) -> None:
        """Fix a motion's ends."""
        for node, end in ((0, self.start), (-1, self.goal)):
            motion.states[POSITION, node] = end.position
            motion.states[VELOCITY, node] = end.velocity
            motion.states[RATES, node] = 0.0
        motion.states[ATTITUDE, 0] = self.q_start
        if self.mesh.continuous:
            motion.starts[:, 0] = self.start.collective, 0.0, 0.0
            motion.ends[:, -1] = self.goal.collective, 0.0, 0.0

    def _cost(self, motion: CollocatedMotion) -> Any:
        """The duration, and a little for changing the input."""
        ca, scale = import_casadi(), import_casadi().DM(1.0 / self.mesh.input_scale)
        changes = (motion.ends - motion.starts, motion.starts[:, 1:] - motion.ends[:, :-1])
        spread = sum(ca.sumsqr(ca.diag(scale) @ change) for change in changes)
        return ca.sum1(motion.phases) + CHANGE_COST / self.mesh.total * spread


@dataclass
class _Rows:
    """Constraints as they come."""

    expressions: list[Any] = field(default_factory=list)
    lower: list[Array] = field(default_factory=list)
    upper: list[Array] = field(default_factory=list)

    def hold(self, values: Any, lower: ArrayLike, upper: ArrayLike) -> None:
        """lower ≤ values ≤ upper, every column alike."""
        rows, columns = values.shape
        self.expressions.append(import_casadi().vec(values))
        self.lower.append(np.tile(np.broadcast_to(lower, rows), columns))
        self.upper.append(np.tile(np.broadcast_to(upper, rows), columns))

    def stacked(self) -> tuple[Any, Array, Array]:
        """All of them in one column."""
        return (
            import_casadi().vertcat(*self.expressions),
            np.concatenate(self.lower),
            np.concatenate(self.upper),
        )
