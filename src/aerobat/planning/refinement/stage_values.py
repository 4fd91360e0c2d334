"""Constraints of stages at their knots and on the body's room in crossed gates, with two derivatives."""

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

KNOWN = 3  # derivatives that stages ask of: position, velocity, acceleration
STATE = 3 * KNOWN  # their components
DIRECTIONS = np.eye(STATE)
BALL_SHARE = 1.0 - 1e-5  # of a ball's squared radius: rounding has the rest


@dataclass(frozen=True, eq=False)
class StageValues:
    """Inequalities ≤ 0 and equalities = 0 on derivatives at stages, (stages, 6, 3), as fractions of sizes.

    Inequalities are those of conditions, then of balls, then of room in gates.
    """

    stages: tuple[Stage, ...]
    task: Task
    in_gates: tuple[BodyInGate, ...] = ()

    def inequalities(self, derivatives: Array) -> Array:
        """The values, (q,)."""
        linear = self._unequal.values(derivatives)
        balls = [float(offset @ offset) - BALL_SHARE for _, offset, _ in self._in_balls(derivatives)]
        rooms = [
            room.scale * room.functions.values(*room.given(derivatives), NO_DIRECTION)[0, :, 0]
            for room in self._rooms
        ]
        return np.concatenate([linear, balls, *rooms])

    @property
    def inequality_count(self) -> int:
        """q."""
        rooms = sum(len(room.scale) for room in self._rooms)
        return len(self._unequal.bounds) + len(self._balls) + rooms

    def equalities(self, derivatives: Array) -> Array:
        """The values, (p,)."""
        return self._equal.values(derivatives)

    def inequality_slopes(self, derivatives: Array) -> tuple[Indices, Array]:
        """The stages of inequalities, (q,), and their slopes by the derivatives there, (q, 6, 3)."""
        at, weights, _ = self._unequal
        if not (self._balls or self._rooms):
            return at, weights
        stages, slopes = at.tolist(), [*weights]
        for stage, offset, radius in self._in_balls(derivatives):
            stages.append(stage)
            slopes.append(np.zeros((6, 3)))
            slopes[-1][0] = 2.0 * offset / radius
        for room in self._rooms:
            found = room.functions.slopes(*room.given(derivatives), DIRECTIONS)[..., 0].T
            for value in room.scale[:, None] * found:
                stages.append(room.stage)
                slopes.append(np.zeros((6, 3)))
                slopes[-1][:KNOWN] = value.reshape(KNOWN, 3)
        return np.array(stages, dtype=np.intp), np.array(slopes).reshape(-1, 6, 3)

    def equality_slopes(self) -> tuple[Indices, Array]:
        """The stages of equalities, (p,), and their slopes by the derivatives there, (p, 6, 3)."""
        return self._equal.at, self._equal.weights

    def second_derivatives(self, derivatives: Array, weights: Array) -> Array:
        """Return the second derivatives of the weighted inequalities, (stages, 9, 9).

        The derivatives are by position, velocity and acceleration at stages.
        """
        found = np.zeros((len(self.stages), STATE, STATE))
        first = len(self._unequal.bounds)
        for stage, _, radius in self._in_balls(derivatives):
            found[stage, :3, :3] += weights[first] * 2.0 / radius**2 * np.eye(3)
            first += 1
        for room in self._rooms:
            own = room.scale * weights[first : first + len(room.scale)]
            found[room.stage] += room.functions.curvature(*room.given(derivatives, own), DIRECTIONS)[..., 0]
            first += len(room.scale)
        return found

    def _in_balls(self, derivatives: Array) -> Iterator[tuple[int, Array, float]]:
        """Stages with a ball, the place in it over its radius, and that [m]."""
        for stage, ball in self._balls:
            yield stage, (derivatives[stage, 0] - ball.centre) / ball.radius, ball.radius

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
        """Those conditions of stages that are equalities, or those that are not."""
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
        """Each body in a gate, with the functions of its room."""
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
    """Conditions as weights · derivatives ≤ bounds, or = bounds."""

    at: Indices  # the stage of each, (q,)
    weights: Array  # (q, 6, 3)
    bounds: Array  # (q,)

    def values(self, derivatives: Array) -> Array:
        """The excess over bounds of derivatives at stages (stages, 6, 3), (q,)."""
        return np.asarray(np.einsum("qka,qka->q", self.weights, derivatives[self.at]) - self.bounds)


class _Room(NamedTuple):
    """The room of a body in a gate."""

    stage: int
    functions: SmoothFunctions
    shared: Array  # body, balance and opening, as the functions take them
    scale: Array  # of the values, (2 K + 1,)

    def given(self, derivatives: Array, *more: Array) -> tuple[Array, Array]:
        """Inputs of the functions: what is shared, and the state at the stage, then more."""
        state = derivatives[self.stage, :KNOWN].ravel()
        return self.shared, np.concatenate([state, *more])[None]


@lru_cache(maxsize=8)
def room_functions(sides: int) -> SmoothFunctions:
    """The room in an opening of so many sides, as the state of its stage moves."""

    def kernel(
        ops: Ops, shared: Sequence[Scalar], state: Sequence[Scalar], _: Sequence[Scalar]
    ) -> Sequence[Scalar]:
        (position, velocity, acceleration), (constant,) = triples(state), triples(shared[5:8])
        thrust = add(add_scaled(acceleration, shared[4], velocity), constant)
        extent = extent_of_thrust(ops, shared[:4], thrust)
        return [*OpeningAhead.of_parameters(shared[8:]).room(ops, position, velocity, extent)]

    return smooth_functions(kernel, 16 + 4 * sides, STATE)


def _sides(limit: Limit, is_equality: bool) -> Iterator[tuple[Array, float]]:
    """Yield a limit's sides as weights (6, 3) and the bound that they keep below; of an equality one."""
    for sign, end in zip((-1.0, 1.0), limit.ends, strict=True):
        if isfinite(end):
            yield sign / limit.size * limit.quantity.path, sign * end
            if is_equality:
                return


def _room_scale(body: BodyInGate) -> Array:
    """Factors that make what is missing of values of a room, as fractions of a size, (2 K + 1,)."""
    count = 2 * len(body.gate.opening.sides[1])
    return -1.0 / np.array([body.gate.opening.inradius * body.min_speed] * count + [body.min_speed])
