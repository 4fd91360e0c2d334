"""What stages ask at their places in polynomials, and ways of the body through gates, in CasADi's symbols."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import inf, perm
from typing import Any

import numpy as np

from aerobat.arrays import Array
from aerobat.limits import Limit
from aerobat.limits.body_in_gate import BodyInGate, extent_of_thrust
from aerobat.limits.path_condition import limit_of
from aerobat.optimization.nonlinear import SymbolicOps, components, import_casadi
from aerobat.planning.polynomial.descent.knot_variables import KnotVariables
from aerobat.planning.polynomial.descent.path_limits import (
    ORDERS,
    POLYNOMIAL_DEGREE,
    TO_COEFFICIENTS,
    PathLimits,
)
from aerobat.problem.ball import Ball
from aerobat.problem.condition import ForceBalance

BALL_SHARE = 1.0 - 1e-5  # of a ball's squared radius: rounding has the rest
NORMAL = 1e-9  # what a direction has of a plane that it is normal to

Row = tuple[Any, float, float]  # a value, the least and the most that it may be


@dataclass(frozen=True, eq=False)
class StageConstraints:
    """Conditions and balls of stages, each at its place, their order and windows, and room in gates.

    A body that passes a gate is taken as one of revolution about its thrust, which encloses it.
    """

    variables: KnotVariables
    limits: PathLimits
    balance: ForceBalance  # that conditions on thrust are about
    in_gates: tuple[BodyInGate, ...] = ()

    def functions(self) -> tuple[Any, Any, Any, tuple[Array, Array]]:
        """Values as a function of x, their Jacobian, their product's Hessian, their limits."""
        ca = import_casadi()
        x = ca.SX.sym("x", self.variables.size)
        rows = [*self._at_places(x), *self._in_order(x)]
        values = ca.vertcat(*(value for value, _, _ in rows), ca.SX(0, 1))
        weights = ca.SX.sym("multipliers", values.numel())
        limits = np.array([(lower, upper) for _, lower, upper in rows]).reshape(-1, 2)
        return (
            ca.Function("values", [x], [values]),
            ca.Function("jacobian", [x], [ca.jacobian(values, x)]),
            ca.Function("hessian", [x, weights], [ca.hessian(ca.dot(values, weights), x)[0]]),
            (limits[:, 0], limits[:, 1]),
        )

    def _at_places(self, x: Any) -> Iterator[Row]:
        """What holds at the stages."""
        variables, in_gates = self.variables, {body.stage: body for body in self.in_gates}
        for j, stage in enumerate(variables.guess.stages):
            place = self._place(j, x)
            for condition in stage.conditions:
                yield from self._held(limit_of(condition, self.balance), place)
            if stage.ball is not None:
                yield self._met(stage.ball, place)
            if j in in_gates:
                yield from self._clear(in_gates[j], place)

    def _place(self, stage: int, x: Any) -> _Place:
        ca, variables = import_casadi(), self.variables
        segment = variables.segments[stage]
        matrix, constant = variables.local(segment)
        ends, duration = self.limits.ends(ca.sparsify(ca.DM(matrix)) @ x + ca.DM(constant))
        coefficients = ca.DM(TO_COEFFICIENTS) @ (duration ** ca.DM(ORDERS.astype(float)) * ends)
        return _Place(coefficients, duration, x[variables.place_columns[stage]])

    def _in_order(self, x: Any) -> Iterator[Row]:
        """Windows of stages, and the order of those in one segment."""
        ca, variables = import_casadi(), self.variables
        columns = variables.place_columns
        starts = ca.cumsum(ca.vertcat(0, x[: variables.guess.trajectory.segments]))
        for j, stage in enumerate(variables.guess.stages):
            segment, (earliest, latest) = variables.segments[j], stage.window
            time = starts[segment] + x[segment] * x[columns[j]]
            if earliest > 0.0:
                yield time / starts[-1], earliest, latest
            elif latest < 1.0:
                yield time / starts[-1], -inf, latest
        for j, (segment, following) in enumerate(pairwise(variables.segments)):
            if segment == following:
                yield x[columns[j + 1]] - x[columns[j]], 0.0, inf

    def _world(self, place: _Place, order: int) -> Any:
        """A derivative of position at a place in the world frame, (3,)."""
        ca, axes = import_casadi(), self.limits.measures.axes
        vector = ca.DM(axes) @ place.derivative(order).T
        return vector + ca.DM(self.limits.origin) if order == 0 else vector

    def _met(self, ball: Ball, place: _Place) -> Row:
        """The squared distance from a ball's centre, over its radius squared."""
        ca = import_casadi()
        return ca.sumsqr(self._world(place, 0) - ca.DM(ball.centre)) / ball.radius**2, -inf, BALL_SHARE

    def _held(self, limit: Limit, place: _Place) -> Iterator[Row]:
        """A limit that holds there; nothing where no variable matters."""
        ca, axes = import_casadi(), self.limits.measures.axes
        quantity = limit.quantity
        value = float(quantity.path[0] @ self.limits.origin)
        along = {k: quantity.path[k] @ axes for k in quantity.derivatives}
        found = {k: weights for k, weights in along.items() if np.abs(weights).max() >= NORMAL}
        if found:
            value += sum(place.derivative(k) @ ca.DM(weights) for k, weights in found.items())
            yield value / limit.size, *limit.ends

    def _clear(self, body: BodyInGate, place: _Place) -> Iterator[Row]:
        """The room of the body in a gate."""
        ca, ops = import_casadi(), SymbolicOps()
        position, velocity, acceleration = (self._world(place, k) for k in range(3))
        thrust = acceleration + self.balance.drag * velocity + ca.DM(self.balance.constant)
        extent = extent_of_thrust(ops, self.variables.vehicle.bounding_ellipsoid, components(thrust))
        for value in body.opening.room(ops, components(position), components(velocity), extent):
            yield value, 0.0, inf


@dataclass(frozen=True, eq=False)
class _Place:
    """A place in a segment, in symbols."""

    coefficients: Any  # (10, d)
    duration: Any
    s: Any  # normalised time

    def derivative(self, order: int) -> Any:
        """A derivative of position by time in the frame of motion, (1, d)."""
        ca, s = import_casadi(), self.s
        powers = ca.horzcat(*(perm(p, order) * s ** max(p - order, 0) for p in range(POLYNOMIAL_DEGREE + 1)))
        return powers @ self.coefficients / self.duration**order
