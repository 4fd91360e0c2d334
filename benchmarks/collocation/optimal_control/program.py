"""The fastest motion of a rigid body as a nonlinear program: ends, stages, limits, rotors that bear it."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from aerobat.arrays import Array, Indices
from aerobat.limits.body_in_gate import BodyInGate
from aerobat.problem.condition import Condition
from aerobat.problem.stage import Stage
from collocation.nonlinear import NonlinearProgram
from collocation.optimal_control.boundary import FixedEnds
from collocation.optimal_control.bounds import Backoff
from collocation.optimal_control.collocation import CollocatedMotion, CollocationMesh
from collocation.optimal_control.elements import (
    BETWEEN,
    Elements,
    is_of_direction,
    weighted_sum,
)
from collocation.optimal_control.rows import Rows, repeated
from collocation.optimal_control.zero_yaw_rate_body import INPUTS, POSITION, STATES
from collocation.separable import (
    Element,
    ElementFunction,
    SeparableFunction,
    separable_program,
)

SHORTEST_PHASE = 1e-3  # [s]
# [s] for one change of an input by half its range in each interval: far below what is reported, it settles
# what the duration leaves open
CHANGE_COST = 1e-4
BALL_SHARE = 1.0 - 1e-4  # of a ball's radius: what defects leave adds up along a course
PLANE_TOLERANCE = 1e-6  # [m] to either side of it: equalities would repeat those of gates and waypoints in it


@dataclass(frozen=True, eq=False)
class OptimalControl:
    """The fastest motion within its boundary; `stages` hold where one phase ends and the next begins.

    Without rotor lag the input may jump at every node. With it the motion is what lagging rotors can follow:
    their thrusts are continuous, from those that go with one end's acceleration to those of the other.
    """

    elements: Elements
    boundary: FixedEnds
    stages: tuple[Stage, ...]  # (P - 1,)
    in_gates: tuple[BodyInGate, ...]  # among them
    min_thrust: float  # [m/s²] specific thrust at least, which keeps the attitude determined
    reserve: float  # of each rotor's range, kept from either of its ends

    def program(self, mesh: CollocationMesh, backoff: Backoff) -> NonlinearProgram:
        """The program of a mesh's unknowns, with bounds tightened at nodes."""
        rows = Rows()
        self._hold_intervals(rows, mesh, backoff)
        self._hold_nodes(rows, mesh, backoff)
        for index, stage in enumerate(self.stages):
            self._hold_stage(rows, mesh, index, stage)
        for body in self.in_gates:
            self._hold_room(rows, mesh, body)
        self.boundary.hold(rows, mesh)
        lower, upper = (mesh.pack(motion) for motion in self._box(mesh))
        return separable_program(
            SeparableFunction(self._cost(mesh), mesh.size, 1),
            SeparableFunction(rows.elements, mesh.size, rows.count),
            lower=np.concatenate(rows.lower),
            upper=np.concatenate(rows.upper),
            x_min=lower,
            x_max=upper,
        )

    def _hold_intervals(self, rows: Rows, mesh: CollocationMesh, backoff: Backoff) -> None:
        """The equations of motion, rotors, and bounds on the path where it may jump at nodes, or between."""
        elements, bounds = self.elements, self.elements.bounds
        path = len(bounds.path)
        lower, upper = bounds.lower + backoff.low, bounds.upper - backoff.high
        below, above = bounds.kept(self.reserve)[:, path:-1]
        jumping = [i for i, bound in enumerate(bounds.path) if not elements.has_one_value(bound)]
        still, between = np.zeros((mesh.total, STATES)), len(BETWEEN)
        shared = rows.reserve(
            np.hstack([still, np.tile(lower[:, :path], between)]),
            np.hstack([still, np.tile(upper[:, :path], between)]),
        )
        for last in (0, 1):
            least, most = [lower[:, path:-1] + below], [upper[:, path:-1] - above]
            least.append(lower[:, jumping])
            most.append(upper[:, jumping])
            if elements.bounds_rate and not last:
                least.append(np.full((mesh.total, between), -inf))
                most.append(np.tile(self._squared_rates(upper[:, -1:]), between))
            own = rows.reserve(np.hstack(least), np.hstack(most))
            unknowns, fractions = mesh.side_unknowns(last), mesh.fractions[:, None]
            rows.elements.append(Element(elements.sides[last], unknowns, fractions, np.hstack([shared, own])))

    def _hold_nodes(self, rows: Rows, mesh: CollocationMesh, backoff: Backoff) -> None:
        """At inner nodes: what has one value there, the body rate, the plane."""
        bounds = self.elements.bounds
        path = [i for i, bound in enumerate(bounds.path) if self.elements.has_one_value(bound)]
        before, after = np.arange(mesh.total - 1), np.arange(1, mesh.total)  # intervals
        low, high = (np.maximum(b[before], b[after]) for b in (backoff.low, backoff.high))
        rates = self._squared_rates(bounds.upper[-1] - high[:, -1:])
        across = np.full_like(rates, inf if self.elements.plane is None else PLANE_TOLERANCE)
        lower = np.hstack([(bounds.lower + low)[:, path], np.full_like(rates, -inf), -across])
        upper = np.hstack([(bounds.upper - high)[:, path], rates, across])
        if np.isfinite([lower, upper]).any():
            unknowns = np.hstack([mesh.states[1:-1], mesh.inputs[1, before]])
            rows.hold(self.elements.node, unknowns, lower, upper)

    def _hold_stage(self, rows: Rows, mesh: CollocationMesh, index: int, stage: Stage) -> None:
        """What a stage asks of the node where it holds, and when."""
        node = int(np.cumsum(mesh.intervals)[index])
        for jumping, conditions in _by_continuity(stage):
            function, lower, upper = self.elements.at_stage(conditions)
            for side in (1, 0) if jumping and not mesh.continuous else (1,):
                u = mesh.inputs[side, node - side]
                rows.hold(function, np.hstack([mesh.states[node], u])[None], lower, upper)
        if stage.ball is not None:
            there = mesh.states[None, node, POSITION]
            ball = (*stage.ball.centre, BALL_SHARE * stage.ball.radius)
            rows.hold(self.elements.squared_distance, there, -inf, 1.0, ball)
        phases = np.arange(len(mesh.intervals))
        earliest, latest = stage.window
        before = (phases <= index).astype(float)
        for fraction, low, high in ((earliest, 0.0, 0.0 if latest == earliest else inf), (latest, -inf, 0.0)):
            if 0.0 < fraction < 1.0 and (fraction == earliest or latest > earliest):
                rows.hold(weighted_sum(len(phases)), phases[None], low, high, before - fraction)

    def _hold_room(self, rows: Rows, mesh: CollocationMesh, body: BodyInGate) -> None:
        """The room of the body in a gate, at the stage that crosses it."""
        node, parameters = int(np.cumsum(mesh.intervals)[body.stage]), body.parameters
        function = self.elements.room_in_gate(len(parameters))
        free = np.full(function.value.numel_out(), inf)
        rows.hold(function, mesh.states[node : node + 1], np.zeros(len(free)), free, parameters)

    def _squared_rates(self, rates: Array) -> Array:
        return np.asarray((rates / self.elements.rate_scale) ** 2)

    def _box(self, mesh: CollocationMesh) -> tuple[CollocatedMotion, CollocatedMotion]:
        """The least and the most that every unknown may be: what is fixed, and little else."""
        lower, upper = (_filled(mesh, value) for value in (-inf, inf))
        lower.phases[:] = SHORTEST_PHASE
        lower.starts[0] = lower.ends[0] = self.min_thrust
        for motion in (lower, upper):
            self.boundary.fix(motion, mesh.continuous)
        return lower, upper

    def _cost(self, mesh: CollocationMesh) -> list[Element]:
        """The duration, and a little for changing the input."""
        phases = np.arange(len(mesh.intervals))[None]
        changes = [np.hstack([mesh.inputs[0], mesh.inputs[1]])]
        if not mesh.continuous:
            changes.append(np.hstack([mesh.inputs[1, :-1], mesh.inputs[0, 1:]]))
        weight = CHANGE_COST / mesh.total
        duration = _cost_element(weighted_sum(phases.size), phases, np.ones(phases.size))
        return [duration, *(_cost_element(self.elements.change, change, weight) for change in changes)]


def _cost_element(function: ElementFunction, unknowns: Indices, parameters: ArrayLike) -> Element:
    rows = np.zeros((len(unknowns), 1), dtype=int)
    return Element(function, unknowns, repeated(parameters, len(unknowns)), rows)


def _by_continuity(stage: Stage) -> list[tuple[bool, tuple[Condition, ...]]]:
    """A stage's conditions: those on what cannot jump, and those on what can."""
    jumping = [c for c in stage.conditions if c.quantity.derivative == 2 and not is_of_direction(c)]
    steady = [c for c in stage.conditions if not any(c is other for other in jumping)]
    return [(may, tuple(group)) for may, group in ((False, steady), (True, jumping)) if group]


def _filled(mesh: CollocationMesh, value: float) -> CollocatedMotion:
    """A motion whose every number is the same."""
    shapes = ((len(mesh.intervals),), (STATES, mesh.total + 1), (INPUTS, mesh.total), (INPUTS, mesh.total))
    return CollocatedMotion(*(np.full(shape, value) for shape in shapes))
