"""Constraints of stages at their knots and on the body's room in crossed gates, with two derivatives."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import isfinite

import numpy as np

from aerobat.arrays import Array, Indices, Mask, xyz
from aerobat.engines.array_functions import COMPLEX_STEP, ArrayFunction, array_function, gradient
from aerobat.engines.tracing import Symbol, Trace, TraceOps
from aerobat.kernels.vectors import add, add_scaled
from aerobat.limits.body_in_gate import BodyInGate, OpeningAhead, extent_of_thrust
from aerobat.limits.limit import Limit
from aerobat.limits.path_condition import limit_of
from aerobat.planning.task import Task
from aerobat.problem.ball import Ball
from aerobat.problem.problem import DERIVATIVES
from aerobat.problem.stage import Stage

KNOWN = 3  # derivatives that stages ask of: position, velocity, acceleration
STATE = 3 * KNOWN  # their components
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
        at, weights, bounds, equal = self._linear
        linear = np.sum(weights[~equal] * derivatives[at[~equal]], axis=(1, 2)) - bounds[~equal]
        balls = [float(offset @ offset) - BALL_SHARE for _, offset, _ in self._in_balls(derivatives)]
        rooms = [
            np.real(self._functions[k][0](self._given(k, derivatives[body.stage])))
            for k, body in enumerate(self.in_gates)
        ]
        return np.concatenate([linear, balls, *rooms])

    @property
    def inequality_count(self) -> int:
        """q."""
        rooms = sum(_room_count(body) for body in self.in_gates)
        return int((~self._linear[3]).sum()) + len(self._balls) + rooms

    def equalities(self, derivatives: Array) -> Array:
        """The values, (p,)."""
        at, weights, bounds, equal = self._linear
        return np.asarray(np.sum(weights[equal] * derivatives[at[equal]], axis=(1, 2)) - bounds[equal])

    def inequality_slopes(self, derivatives: Array) -> tuple[Indices, Array]:
        """The stages of inequalities, (q,), and their slopes by the derivatives there, (q, 6, 3)."""
        at, weights, _, equal = self._linear
        stages, slopes = at[~equal].tolist(), [*weights[~equal]]
        for stage, offset, radius in self._in_balls(derivatives):
            stages.append(stage)
            slopes.append(np.zeros((6, 3)))
            slopes[-1][0] = 2.0 * offset / radius
        for k, body in enumerate(self.in_gates):
            found = self._functions[k][0](self._stepped(k, derivatives[body.stage]))
            for value in found:
                stages.append(body.stage)
                slopes.append(np.zeros((6, 3)))
                slopes[-1][:KNOWN] = (
                    np.broadcast_to(np.imag(value), (STATE,)).reshape(KNOWN, 3) / COMPLEX_STEP
                )
        return np.array(stages, dtype=np.intp), np.array(slopes).reshape(-1, 6, 3)

    def equality_slopes(self) -> tuple[Indices, Array]:
        """The stages of equalities, (p,), and their slopes by the derivatives there, (p, 6, 3)."""
        at, weights, _, equal = self._linear
        return at[equal], weights[equal]

    def second_derivatives(self, derivatives: Array, weights: Array) -> Array:
        """Return the second derivatives of the weighted inequalities, (stages, 9, 9).

        The derivatives are by position, velocity and acceleration at stages.
        """
        found = np.zeros((len(self.stages), STATE, STATE))
        first = int((~self._linear[3]).sum())
        for stage, _, radius in self._in_balls(derivatives):
            found[stage, :3, :3] += weights[first] * 2.0 / radius**2 * np.eye(3)
            first += 1
        for k, body in enumerate(self.in_gates):
            _, by_state = self._functions[k]
            count = _room_count(body)
            own = weights[first : first + count]
            slopes = by_state([*self._stepped(k, derivatives[body.stage]), *own])
            second = [np.broadcast_to(np.imag(each), (STATE,)) / COMPLEX_STEP for each in slopes]
            found[body.stage] += np.array(second)
            first += count
        return found

    def _in_balls(self, derivatives: Array) -> Iterator[tuple[int, Array, float]]:
        """Stages with a ball, the place in it over its radius, and that [m]."""
        for stage, ball in self._balls:
            yield stage, (derivatives[stage, 0] - ball.centre) / ball.radius, ball.radius

    @cached_property
    def _balls(self) -> tuple[tuple[int, Ball], ...]:
        return tuple((k, stage.ball) for k, stage in enumerate(self.stages) if stage.ball is not None)

    @cached_property
    def _linear(self) -> tuple[Indices, Array, Array, Mask]:
        """Conditions as weights · derivatives ≤ bounds: stages (q,), weights, bounds, equalities."""
        rows = [
            (k, *row, condition.lower == condition.upper)
            for k, stage in enumerate(self.stages)
            for condition in stage.conditions
            for row in _sides(limit_of(condition, self.task.balance), condition.lower == condition.upper)
        ]
        return (
            np.array([row[0] for row in rows], dtype=np.intp),
            np.array([row[1] for row in rows]).reshape(-1, 6, 3),
            np.array([row[2] for row in rows]),
            np.array([row[3] for row in rows], dtype=bool),
        )

    def _given(self, k: int, state: Array) -> list[float]:
        """What the functions of a gate take: the state there (6, 3), and the gate's opening."""
        return [*state[:KNOWN].ravel().tolist(), *self.in_gates[k].parameters.tolist()]

    def _stepped(self, k: int, state: Array) -> list[Array | float]:
        """The same with each component of the state in turn moved by a complex step."""
        moved = state[:KNOWN].ravel() + 1j * COMPLEX_STEP * np.eye(STATE)
        return [*moved.T, *self.in_gates[k].parameters.tolist()]

    @cached_property
    def _functions(self) -> tuple[tuple[ArrayFunction, ArrayFunction], ...]:
        """Of each gate, what is missing of the room, and slopes by the state of its weighted sum."""
        return tuple(self._room_functions(body) for body in self.in_gates)

    def _room_functions(self, room: BodyInGate) -> tuple[ArrayFunction, ArrayFunction]:
        trace = Trace()
        ops = TraceOps(trace)
        position, velocity, acceleration = (trace.vector(name) for name in DERIVATIVES[:KNOWN])
        parameters = [trace.input(f"opening {i}") for i in range(len(room.parameters))]
        balance, body = self.task.balance, self.task.vehicle.bounding_ellipsoid
        thrust = add(add_scaled(acceleration, balance.drag, velocity), xyz(balance.constant))
        extent = extent_of_thrust(ops, body, thrust)
        *sides, speed = OpeningAhead.of_parameters(parameters).room(ops, position, velocity, extent)
        size = room.gate.opening.inradius * room.min_speed
        missing: list[Symbol] = [trace.symbol(-1.0 / size * side) for side in sides]
        missing.append(trace.symbol(-1.0 / room.min_speed * speed))
        weights = [trace.input(f"weights {i}") for i in range(len(missing))]
        total = trace.symbol(sum(w * value for w, value in zip(weights, missing, strict=True)))
        state = [*position, *velocity, *acceleration]
        given = [*state, *parameters]
        return array_function(given, missing), array_function([*given, *weights], gradient(total, state))


def _sides(limit: Limit, is_equality: bool) -> Iterator[tuple[Array, float]]:
    """Yield a limit's sides as weights (6, 3) and the bound that they keep below; of an equality one."""
    for sign, end in zip((-1.0, 1.0), limit.ends, strict=True):
        if isfinite(end):
            yield sign / limit.size * limit.quantity.path, sign * end
            if is_equality:
                return


def _room_count(body: BodyInGate) -> int:
    """The number of inequalities of a body's room in a gate."""
    return 2 * len(body.gate.opening.sides[1]) + 1
