"""Constraints of stages at their knots, and on the body's room in crossed gates, with two derivatives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import isfinite
from typing import NamedTuple

import numpy as np

from aerobat.arrays import Array, Indices
from aerobat.engines.llvm.functions import NO_DIRECTION, SmoothFunctions, smooth_functions, triples
from aerobat.kernels.ops import Ops, Scalar
from aerobat.kernels.vectors import add, add_scaled
from aerobat.limits.body_in_gate import BodyInGate, OpeningAhead, extent_of_thrust
from aerobat.limits.limit import Limit
from aerobat.limits.path_condition import limit_of
from aerobat.planning.task import Task
from aerobat.problem.ball import Ball
from aerobat.problem.stage import Stage

MOTION = 4  # number of derivatives that constraints at stages depend on: position to jerk
STATE = 3 * MOTION  # number of their components
DIRECTIONS = np.eye(STATE)
BALL_FRACTION = 1.0 - 1e-5  # fraction of a ball's squared radius that is used; the rest allows for rounding


@dataclass(frozen=True, eq=False)
class StageValues:
    """Constraints of stages on the derivatives there, (stages, 6, 3), as fractions of their sizes.

    Inequalities ≤ 0 are those of conditions, then of balls, then of room in gates. Equalities = 0 are those
    of conditions.
    """

    stages: tuple[Stage, ...]
    task: Task
    in_gates: tuple[BodyInGate, ...] = ()

    def inequalities(self, derivatives: Array) -> Array:
        """Return the values of the inequalities, (q,)."""
        linear = self._unequal.values(derivatives)
        balls = [float(offset @ offset) - BALL_FRACTION for _, offset, _ in self._in_balls(derivatives)]
        return np.concatenate([linear, balls, *self._in_rooms(derivatives)])

    @property
    def without_rooms(self) -> int:
        """The number of inequalities before those of room in gates."""
        return len(self._unequal.bounds) + len(self._balls)

    def missing_room(self, derivatives: Array) -> float:
        """Return the largest value of the inequalities of room in gates; zero without gates.

        Args:
            derivatives: Position to jerk at the stages, or more, (stages, MOTION or more, 3).
        """
        return max((float(values.max()) for values in self._in_rooms(derivatives)), default=0.0)

    def equalities(self, derivatives: Array) -> Array:
        """Return the values of the equalities, (p,)."""
        return self._equal.values(derivatives)

    def inequality_slopes(self, derivatives: Array) -> tuple[Indices, Array]:
        """Return each inequality's stage, (q,), and its slopes by the derivatives there, (q, 6, 3)."""
        at, weights, _ = self._unequal
        if not (self._balls or self._rooms):
            return at, weights
        stages, slopes = at.tolist(), [*weights]
        for stage, offset, radius in self._in_balls(derivatives):
            stages.append(stage)
            slopes.append(np.zeros((6, 3)))
            slopes[-1][0] = 2.0 * offset / radius
        for room in self._rooms:
            found = room.functions.slopes(*room.inputs(derivatives), DIRECTIONS)[..., 0].T
            for value in room.scale[:, None] * found:
                stages.append(room.stage)
                slopes.append(np.zeros((6, 3)))
                slopes[-1][:MOTION] = value.reshape(MOTION, 3)
        return np.array(stages, dtype=np.intp), np.array(slopes).reshape(-1, 6, 3)

    def equality_slopes(self) -> tuple[Indices, Array]:
        """Return each equality's stage, (p,), and its slopes by the derivatives there, (p, 6, 3)."""
        return self._equal.at, self._equal.weights

    def second_derivatives(self, derivatives: Array, weights: Array) -> Array:
        """Return the Hessian of the weighted inequalities by position to jerk, (stages, STATE, STATE)."""
        found = np.zeros((len(self.stages), STATE, STATE))
        first = len(self._unequal.bounds)
        for stage, _, radius in self._in_balls(derivatives):
            found[stage, :3, :3] += weights[first] * 2.0 / radius**2 * np.eye(3)
            first += 1
        for room in self._rooms:
            own = room.scale * weights[first : first + len(room.scale)]
            found[room.stage] += room.functions.curvature(*room.inputs(derivatives, own), DIRECTIONS)[..., 0]
            first += len(room.scale)
        return found

    def _in_balls(self, derivatives: Array) -> Iterator[tuple[int, Array, float]]:
        """Yield each stage with a ball, its offset from the centre over the radius, and the radius [m]."""
        for stage, ball in self._balls:
            yield stage, (derivatives[stage, 0] - ball.centre) / ball.radius, ball.radius

    def _in_rooms(self, derivatives: Array) -> Iterator[Array]:
        """Yield the values of each room's inequalities, (2 K + 1,)."""
        for room in self._rooms:
            yield room.scale * room.functions.values(*room.inputs(derivatives), NO_DIRECTION)[0, :, 0]

    @cached_property
    def _balls(self) -> tuple[tuple[int, Ball], ...]:
        return tuple((k, stage.ball) for k, stage in enumerate(self.stages) if stage.ball is not None)

    @cached_property
    def _unequal(self) -> _Linear:
        return self._conditions(equal=False)

    @cached_property
    def _equal(self) -> _Linear:
        return self._conditions(equal=True)

    def _conditions(self, equal: bool) -> _Linear:
        """Return the conditions of stages that are equalities, or the inequalities."""
        rows = [
            (k, *row)
            for k, stage in enumerate(self.stages)
            for condition in stage.conditions
            if (condition.lower == condition.upper) is equal
            for row in _sides(limit_of(condition, self.task.balance), equal)
        ]
        return _Linear(
            np.array([row[0] for row in rows], dtype=np.intp),
            np.array([row[1] for row in rows]).reshape(-1, 6, 3),
            np.array([row[2] for row in rows]),
        )

    @cached_property
    def _rooms(self) -> tuple[_Room, ...]:
        """The room of the body in each gate, as compiled functions."""
        balance, revolved = self.task.balance, self.task.vehicle.bounding_ellipsoid.revolved
        return tuple(
            _Room(
                stage=body.stage,
                functions=room_functions(len(body.gate.opening.sides[1])),
                shared=np.array([*revolved, balance.drag, *balance.constant, *body.parameters]),
                scale=_room_scale(body),
            )
            for body in self.in_gates
        )


class _Linear(NamedTuple):
    """Linear conditions: weights · derivatives ≤ bounds, or = bounds."""

    at: Indices  # the stage of each, (q,)
    weights: Array  # (q, 6, 3)
    bounds: Array  # (q,)

    def values(self, derivatives: Array) -> Array:
        """Return the excess (q,) over the bounds, of derivatives at stages (stages, 6, 3)."""
        return np.asarray(np.einsum("qka,qka->q", self.weights, derivatives[self.at]) - self.bounds)


class _Room(NamedTuple):
    """The room of the body in a gate."""

    stage: int
    functions: SmoothFunctions
    shared: Array  # parameters of body, balance and opening, in the functions' order
    scale: Array  # factors on the values, (2 K + 1,)

    def inputs(self, derivatives: Array, *more: Array) -> tuple[Array, Array]:
        """Return the functions' inputs: the shared parameters; the state at the stage, then `more`."""
        state = derivatives[self.stage, :MOTION].ravel()
        return self.shared, np.concatenate([state, *more])[None]


@lru_cache(maxsize=8)
def room_functions(sides: int) -> SmoothFunctions:
    """Compile the room in an opening with `sides` sides, as functions of the state at its stage."""

    def kernel(
        ops: Ops, shared: Sequence[Scalar], state: Sequence[Scalar], _: Sequence[Scalar]
    ) -> Sequence[Scalar]:
        (position, velocity, acceleration, jerk), (constant,) = triples(state), triples(shared[5:8])
        opening = OpeningAhead.of_parameters(shared[8:])
        thrust = add(add_scaled(acceleration, shared[4], velocity), constant)
        thrust_change = add_scaled(jerk, shared[4], acceleration)
        time = opening.time_of_turning(ops, velocity)
        behind, before = (
            extent_of_thrust(ops, shared[:4], add_scaled(thrust, sign * time, thrust_change))
            for sign in (1.0, -1.0)
        )
        return [*opening.clearances(ops, position, velocity, (behind, before))]

    return smooth_functions(kernel, 17 + 4 * sides, STATE)


def _sides(limit: Limit, is_equality: bool) -> Iterator[tuple[Array, float]]:
    """Yield a limit's finite ends as weights (6, 3) and upper bound; of an equality only one."""
    for sign, end in zip((-1.0, 1.0), limit.ends, strict=True):
        if isfinite(end):
            yield sign / limit.size * limit.quantity.path, sign * end
            if is_equality:
                return


def _room_scale(body: BodyInGate) -> Array:
    """Return factors that turn room into scaled violations ≤ 0, (2 K + 1,)."""
    count = 2 * len(body.gate.opening.sides[1])
    return -1.0 / np.array([body.gate.opening.inradius * body.min_speed] * count + [body.min_speed])
