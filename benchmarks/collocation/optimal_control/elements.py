"""The functions that the program is made of, each of a few scaled unknowns, whatever the mesh."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from math import inf
from typing import Any

import numpy as np

from aerobat.arrays import Array
from aerobat.kernels.quaternions import axes
from aerobat.limits.body_in_gate import OpeningAhead, extent_of_attitude
from aerobat.limits.limit import Limit
from aerobat.limits.path_condition import limit_of
from aerobat.planning.task import Task
from aerobat.problem.condition import Condition, Quantity
from collocation.nonlinear import SymbolicOps, components, import_casadi
from collocation.optimal_control.bounds import Bounds
from collocation.optimal_control.collocation import (
    STATE_SCALE,
    CollocationMesh,
    IntervalSide,
)
from collocation.optimal_control.zero_yaw_rate_body import (
    ATTITUDE,
    INPUTS,
    POSITION,
    RATES,
    STATES,
    VELOCITY,
    ZeroYawRateBody,
)
from collocation.separable import ElementFunction

BETWEEN = (0.25, 0.5, 0.75)  # of an interval: where bounds on the path are held too, beside its nodes
RATE_SCALE = 10.0  # [rad/s] of body rates that have no bound


@dataclass(frozen=True, eq=False)
class Elements:
    """The functions of motions that a task asks for, in a plane if there is one."""

    task: Task
    plane: Array | None = None  # its normal, (3,); it holds the start

    @cached_property
    def body(self) -> ZeroYawRateBody:
        """The equations of motion."""
        return ZeroYawRateBody(self.task.vehicle, self.task.environment)

    @cached_property
    def bounds(self) -> Bounds:
        """The bounds that hold all along the motion."""
        return Bounds.of(self.task)

    @property
    def continuous(self) -> bool:
        """True where the input cannot jump, for the rotors lag."""
        return bool(self.task.vehicle.lags.any())

    def mesh(self, intervals: tuple[int, ...]) -> CollocationMesh:
        """The unknowns of so many equal intervals in each phase."""
        return CollocationMesh.even(intervals, self.continuous, self.input_scale)

    @property
    def input_scale(self) -> Array:
        """The size of the inputs [m/s², rad/s², rad/s²], (3,)."""
        vehicle = self.task.vehicle
        spread = np.abs(vehicle.allocation[:INPUTS]) @ vehicle.thrust_ranges / 2
        return np.asarray(spread / [vehicle.mass, vehicle.inertia[0, 0], vehicle.inertia[1, 1]])

    @property
    def rate_scale(self) -> float:
        """The size of body rates [rad/s]."""
        return RATE_SCALE if self.bounds.rate is None else min(self.bounds.rate.size, RATE_SCALE)

    @property
    def bounds_rate(self) -> bool:
        """True where the vehicle's body rate has a bound."""
        return self.bounds.rate is not None

    def has_one_value(self, limit: Limit) -> bool:
        """True where a linear limit's quantity cannot jump at a node."""
        *_, order = limit.quantity.derivatives
        return order < 2 or (order == 2 and self.continuous)

    @cached_property
    def sides(self) -> tuple[ElementFunction, ElementFunction]:
        """The contributions of either side of an interval to the rows of both, and the side's own rows.

        Rows of both: defects, path bounds between nodes. A side's own: rotors, path bounds that may jump at
        nodes, and squared body rates between nodes, of the first side alone.
        """
        first, last = (self._side(last) for last in (0, 1))
        return first, last

    def _side(self, last: int) -> ElementFunction:
        ca, side = import_casadi(), IntervalSide(self.body, self.input_scale, last)
        path = self.bounds.path
        between = [_weighted(b, side.between(s)) for s in BETWEEN for b in path]
        jumping = [_weighted(b, side.here()) for b in path if not self.has_one_value(b)]
        driven = self.body.driven(self.bounds.weights)(side.state, side.input, side.slope)
        turning = []
        if self.bounds_rate and not last:
            turning = [ca.sumsqr(side.body_rate(s)) / self.rate_scale**2 for s in BETWEEN]
        values = ca.vertcat(side.defect(), *between, driven, *jumping, *turning)
        return ElementFunction(ca.Function("side", [side.unknowns, side.fraction], [values]))

    @cached_property
    def node(self) -> ElementFunction:
        """Path bounds that have one value, the squared body rate, and the distance from the plane."""
        ca, node = import_casadi(), _MeshNode(self)
        path = [_weighted(b, node.derivatives) for b in self.bounds.path if self.has_one_value(b)]
        rate = ca.sumsqr(node.state[RATES]) / self.rate_scale**2
        across = ca.SX.zeros(1)
        if self.plane is not None:
            across = ca.dot(ca.DM(self.plane), node.state[POSITION] - ca.DM(self.task.problem.start.position))
        return node.function(ca.vertcat(*path, rate, across))

    def at_stage(self, conditions: tuple[Condition, ...]) -> tuple[ElementFunction, Array, Array]:
        """Values of conditions at a node, and their bounds; drag is counted."""
        ca, node = import_casadi(), _MeshNode(self)
        values, ends = [], []
        for condition in conditions:
            limit = limit_of(condition, self.task.balance)
            if is_of_direction(condition):
                values.append(ca.dot(ca.DM(condition.direction), node.thrust_axis))
                ends.append((condition.lower, condition.upper))
            else:
                values.append(_weighted(limit, node.derivatives))
                ends.append((limit.size * limit.ends[0], limit.size * limit.ends[1]))
        lower, upper = np.array(ends).T
        return node.function(ca.vertcat(*values)), lower, upper

    @cached_property
    def squared_distance(self) -> ElementFunction:
        """The squared distance from a centre (3,) in radii of a ball, the parameters, of scaled positions."""
        ca = import_casadi()
        z, ball = ca.SX.sym("z", 3), ca.SX.sym("ball", 4)
        distance = (z * STATE_SCALE[POSITION] - ball[:3]) / ball[3]
        return ElementFunction(ca.Function("distance", [z, ball], [ca.sumsqr(distance)]))

    def room_in_gate(self, parameters: int) -> ElementFunction:
        """The values of `OpeningAhead.clearances` of a scaled state, by so many parameters of an opening."""
        ca, ops = import_casadi(), SymbolicOps()
        z, opening = ca.SX.sym("z", STATES), ca.SX.sym("opening", parameters)
        state = z * STATE_SCALE
        position, velocity, attitude = (components(state[part]) for part in (POSITION, VELOCITY, ATTITUDE))
        extent = extent_of_attitude(ops, self.task.vehicle.bounding_ellipsoid, axes(attitude))
        values = OpeningAhead.of_parameters(components(opening)).clearances(
            ops, position, velocity, (extent, extent)
        )
        return ElementFunction(ca.Function("room", [z, opening], [ca.vertcat(*values)]))

    @cached_property
    def goal_thrust(self) -> ElementFunction:
        """A thrust (3,), the parameter, in body axes."""
        ca = import_casadi()
        z, thrust = ca.SX.sym("z", STATES), ca.SX.sym("thrust", 3)
        return ElementFunction(ca.Function("goal", [z, thrust], [self.body.axes(z * STATE_SCALE).T @ thrust]))

    @cached_property
    def change(self) -> ElementFunction:
        """The squared change of scaled inputs (2, 3), times the parameter."""
        ca = import_casadi()
        z, weight = ca.SX.sym("z", 2 * INPUTS), ca.SX.sym("weight")
        change = weight * ca.sumsqr(z[INPUTS:] - z[:INPUTS])
        return ElementFunction(ca.Function("change", [z, weight], [change]))


def weighted_sum(count: int) -> ElementFunction:
    """The function of so many unknowns that is their sum, weighted by as many parameters."""
    ca = import_casadi()
    z, weights = ca.SX.sym("z", count), ca.SX.sym("weights", count)
    return ElementFunction(ca.Function("sum", [z, weights], [ca.dot(weights, z)]))


def is_of_direction(condition: Condition) -> bool:
    """True of conditions on the thrust's direction alone, which cannot jump where the thrust may."""
    on_thrust = condition.quantity is Quantity.SPECIFIC_THRUST
    return on_thrust and {condition.lower, condition.upper} <= {-inf, 0.0, inf}


class _MeshNode:
    """A node in symbols: its scaled state and input, and what they mean."""

    def __init__(self, elements: Elements) -> None:
        ca = import_casadi()
        self.unknowns = ca.SX.sym("z", STATES + INPUTS)
        z = self.unknowns * np.concatenate([STATE_SCALE, elements.input_scale])
        self.state = z[:STATES]
        self.thrust_axis = elements.body.axes(self.state)[:, 2]
        rates = elements.body.derivatives(self.state, z[STATES:], ca.DM.zeros(INPUTS))
        self.derivatives = [self.state[POSITION], self.state[VELOCITY], rates[0][VELOCITY]]

    def function(self, values: Any) -> ElementFunction:
        """The function of values here."""
        ca = import_casadi()
        return ElementFunction(ca.Function("node", [self.unknowns, ca.SX.sym("none", 0)], [values]))


def _weighted(limit: Limit, derivatives: Iterable[Any]) -> Any:
    """A linear limit's quantity of derivatives of position in symbols, less what is constant."""
    ca, pairs = import_casadi(), zip(limit.quantity.path, derivatives, strict=False)
    return sum(ca.dot(ca.DM(weights), values) for weights, values in pairs if weights.any())
