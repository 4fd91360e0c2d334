"""The yaw that follows a heading as closely as the rotors allow, along a path that stays unchanged.

The yaw is a spline. It minimizes the weighted squared error from the required heading, plus a small weight on
the squared third derivative, within all limits along the path. The method is sequential quadratic programming
from several starts. One of the starts, no turn at all, satisfies all limits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import degrees, inf

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.errors import Infeasible, Reason
from aerobat.flatness import has_unequal_drag
from aerobat.optimization.quadratic import quadratic_minimum
from aerobat.planning.heading.yaw_limits import ORDERS, YawLimits
from aerobat.planning.heading.yaw_spline import PER_KNOT, YawSpline
from aerobat.planning.result import Plan
from aerobat.planning.task import Task
from aerobat.problem.heading import Heading, HeadingMode
from aerobat.problem.problem import Problem
from aerobat.states import FlatState
from aerobat.vehicle import Vehicle

RESERVE_FRACTION = 0.5  # fraction of the path's reserve that stays for the controller; the rest is for yaw
# fractions of each part at which limits are evaluated: not at its knots, and denser near them, where limits
# change fast
PLACES = 0.5 - 0.5 * np.cos(np.pi * np.array([0.006, *np.arange(1, 8) / 8, 0.994]))
# quadrature weights of PLACES
PLACE_WEIGHTS = np.diff(0.5 * (PLACES[1:] + PLACES[:-1]), prepend=0.0, append=1.0)
SMOOTH = 1e-6  # weight [s⁶] of the squared third derivative: smooths required turns above about 10 rad/s
MIN_HEADING_WEIGHT = 0.3  # weight of the required heading below which it is ignored; the full weight is 1
ACTIVE_DISTANCE = 0.5  # distance from a limit, relative to its size, within which a step respects it
SLACK = 1e-3  # constraint violation at samples that counts as none, relative to the limit's size
REACH, LEAST_REACH = 0.6, 2e-3  # largest yaw change of the first step, and the one at which steps end [rad]
ROUNDS = 60  # largest number of steps
SMOOTHER = (1.0, 30.0, 1000.0)  # factors on SMOOTH of the unconstrained optima at which searches start
# scale of the smoother optima, which are starts too: the whole turns may violate limits by far
START_SCALE = 0.4
RESTORED = 0.5  # fraction of a constraint violation that one step removes
MIN_DECREASE = 1e-4  # relative decrease of the cost below which steps end
# (additional reserve as a fraction of limits' sizes, factor on the turn), tried in turn until certified
WHOLE = tuple((more, 1.0) for more in (0.0, 0.005, 0.01, 0.02, 0.04, 0.08))
TRIES = (*WHOLE, (0.08, 0.6), (0.08, 0.3), (0.08, 0.0))


def with_heading(plan: Plan, reserve: float) -> Plan:
    """Return a plan whose body follows its problem's heading; plans with a free heading are unchanged.

    The first of TRIES that leaves the rotors RESERVE_FRACTION of the reserve is taken, else the first that is
    certified. Raises Infeasible where the heading's tolerance is not kept.

    Args:
        plan: A plan without yaw.
        reserve: The reserve that the plan keeps, as a fraction of its limits.
    """
    heading = plan.problem.heading
    if heading.mode is HeadingMode.FREE or plan.vehicle is None:
        return plan
    spline, tried = YawSpline.along(plan.trajectory), []
    for more, left in TRIES:
        task = Task.of(plan.problem, plan.vehicle, RESERVE_FRACTION * reserve + more)
        found = _turned(plan, spline, _YawProgram(task, heading, spline).best(left))
        if found.keeps(RESERVE_FRACTION * reserve) or not plan.certified:
            break
        tried.append(found)
    else:
        found = next((each for each in tried if each.certified), found)
    if plan.certified and not found.certified:
        why = "" if found.certificate is None else found.certificate.why
        sentence = f"no turn is proven that follows the heading: {why}; {_remedy(plan.problem, plan.vehicle)}"
        raise Infeasible(Reason(sentence, ("heading", "reserve")))
    error = heading_error(found)
    if error is not None and degrees(error.largest) > heading.tolerance_deg:
        raise Infeasible(
            Reason(
                f"the heading is {degrees(error.largest):.3g}° off what is asked at {error.time:.2f} s, more "
                f"than heading.tolerance_deg = {heading.tolerance_deg:g}; allow more, start nearer to "
                "it (heading_deg), or leave the rotors more with --reserve",
                ("heading.tolerance_deg", "heading_deg", "reserve"),
            )
        )
    return found


def _remedy(problem: Problem, vehicle: Vehicle) -> str:
    """Return what may help where no turn is proven.

    A turn changes the thrust of a vehicle whose drag differs along x and y, so that its lap does not close.
    """
    if not problem.ends and has_unequal_drag(vehicle):
        return "on a closed course, leave the heading free, or take equal drag_body along x and y"
    return "leave more with --reserve"


@dataclass(frozen=True)
class HeadingError:
    """The error of a plan's heading, over the times at which a heading is required."""

    largest: float  # [rad]
    time: float  # [s] of the largest error
    median: float  # [rad]


def heading_error(plan: Plan) -> HeadingError | None:
    """Return the error of a plan's heading; None where the heading is free or never determined."""
    heading = plan.problem.heading
    if heading.mode is HeadingMode.FREE or plan.vehicle is None:
        return None
    times = YawSpline.along(plan.trajectory).times(PLACES)
    limits = YawLimits(Task.of(plan.problem, plan.vehicle), plan.trajectory, times)
    angle, weight = _required(heading, limits)
    off = np.where(weight >= MIN_HEADING_WEIGHT, np.abs(angle), -inf)
    if off.max() < 0.0:
        return None
    worst = int(off.argmax())
    return HeadingError(float(off[worst]), float(times[worst]), float(np.median(off[off >= 0.0])))


def _turned(plan: Plan, spline: YawSpline, variables: Array) -> Plan:
    """Return the plan with a yaw; the path gets the yaw's knots, too."""
    last_parts = np.flatnonzero(np.diff(spline.parts.interval, append=-1)).tolist()  # of each segment
    is_cut = len(spline.seconds) > plan.trajectory.segments
    stages = tuple(replace(stage, interval=last_parts[stage.interval]) for stage in plan.stages)
    dt = None if is_cut else plan.dt
    return replace(plan, trajectory=spline.with_yaw(variables), stages=stages, dt=dt)


def _required(heading: Heading, limits: YawLimits) -> tuple[Array, Array]:
    """Return the angle [rad] about the thrust from body x to the required heading and its weight, (m,)."""
    setpoint, duration = limits.carried, limits.path.duration
    axes = so3.axes(setpoint.q_world_body)
    flat: FlatState = setpoint.flat
    wanted = heading.reference_axes(limits.times / duration, flat, axes[..., 2])
    x, y = (np.sum(wanted * axes[..., k], axis=-1) for k in (0, 1))
    return np.arctan2(y, x), np.hypot(x, y)


@dataclass(frozen=True, eq=False)
class _YawProgram:
    """Sequential quadratic programming for the yaw, in the variables that the ends of the path leave free."""

    task: Task
    heading: Heading
    spline: YawSpline

    def best(self, left: float) -> Array:
        """Return all variables of the best yaw that is found, with its free variables scaled by `left`."""
        free, added = self._ends
        found = [self._improved(start) for start in self._starts()]
        return np.asarray(free @ min(found, key=self._rank) * left + added)

    @cached_property
    def _limits(self) -> YawLimits:
        """The limits at the places of all parts."""
        return YawLimits(self.task, self.spline.cut_path, self.spline.times(PLACES))

    @cached_property
    def _target(self) -> tuple[Array, Array]:
        """The required yaw [rad], without jumps of 2π, and its weight, (m,) each."""
        angle, weight = _required(self.heading, self._limits)
        known = np.flatnonzero(weight >= MIN_HEADING_WEIGHT)
        if not len(known):
            return np.zeros_like(angle), np.zeros_like(weight)
        steady = np.interp(np.arange(len(angle)), known, np.unwrap(angle[known]))
        steady -= 2 * np.pi * np.round(steady[0] / (2 * np.pi))
        return steady, np.where(weight >= MIN_HEADING_WEIGHT, weight, 0.0)

    @cached_property
    def _ends(self) -> tuple[Array, Array]:
        """The affine map from the free variables (v,) to all variables: matrix (n, v) and offset (n,)."""
        count = PER_KNOT * (len(self.spline.seconds) + 1)
        every, added = np.eye(count), np.zeros(count)
        if not self.task.stages.closed:  # fixed: yaw and rates zero at the start, rates zero at the end
            return every[:, PER_KNOT : count - PER_KNOT + 1], added
        path = self.spline.cut_path
        first, last = YawLimits(self.task, path, np.array([0.0, path.duration])).carried.q_world_body
        lag = so3.twist(last, first)
        target = self._target[0]
        added[-PER_KNOT] = lag + 2 * np.pi * np.round((target[-1] - target[0] - lag) / (2 * np.pi))
        free = every[:, : count - PER_KNOT].copy()
        free[-PER_KNOT:, :PER_KNOT] = np.eye(PER_KNOT)
        return free, added

    @cached_property
    def _rows(self) -> list[Array]:
        """The matrices from the free variables to the yaw and its derivatives at the places, (m, v) each."""
        return [self.spline.rows(PLACES, k) @ self._ends[0] for k in range(ORDERS)]

    @cached_property
    def _fixed(self) -> Array:
        """The offsets of the yaw and its derivatives at the places, (4, m)."""
        return np.array([self.spline.rows(PLACES, k) @ self._ends[1] for k in range(ORDERS)])

    @cached_property
    def _error_weights(self) -> Array:
        """The weights of the squared heading errors [s], (m,)."""
        return np.asarray(self._target[1] ** 2 * self._quadrature)

    @cached_property
    def _quadrature(self) -> Array:
        """The quadrature weight of each place [s], (m,)."""
        return np.outer(self.spline.seconds, PLACE_WEIGHTS).ravel()

    def _yaw(self, x: Array) -> Array:
        """Return the yaw and its derivatives at the places, (4, m)."""
        return np.array([each @ x for each in self._rows]) + self._fixed

    def _gradient_and_hessian(self, yaw: Array, smooth: float = SMOOTH) -> tuple[Array, Array]:
        """Return the cost's gradient (v,) and Hessian (v, v)."""
        bend, (value, *_, third) = smooth * self._quadrature, self._rows
        hessian = (value.T * self._error_weights) @ value + (third.T * bend) @ third
        hessian += 1e-9 * np.trace(hessian) / len(hessian) * np.eye(len(hessian))
        off = self._error_weights * (yaw[0] - self._target[0])
        return value.T @ off + third.T @ (bend * yaw[3]), hessian

    def _starts(self) -> list[Array]:
        """Return the starts: no turn, the unconstrained optima for each smoothness, scaled smoother ones."""
        still = np.zeros(self._ends[0].shape[1])
        pairs = [self._gradient_and_hessian(self._yaw(still), SMOOTH * more) for more in SMOOTHER]
        whole = [np.asarray(-np.linalg.solve(hessian, gradient)) for gradient, hessian in pairs]
        return [still, *whole, *(START_SCALE * turn for turn in whole[1:])]

    def _rank(self, x: Array) -> tuple[float, float]:
        """Return the constraint violation (SLACK at least) and the cost, which are compared in this order."""
        yaw = self._yaw(x)
        off = self._error_weights @ (yaw[0] - self._target[0]) ** 2
        exceeded = float(self._limits.excess(yaw).max())
        return max(exceeded, SLACK), float(off + SMOOTH * self._quadrature @ yaw[3] ** 2)

    def _improved(self, x: Array) -> Array:
        """Return an improved yaw: steps reduce first the constraint violation, then the cost."""
        (free, _), limits, reach = self._ends, self._limits, REACH
        is_yaw = np.tile(np.arange(PER_KNOT) == 0, len(free) // PER_KNOT) @ free > 0.0
        rank = self._rank(x)
        for _ in range(ROUNDS):
            yaw = self._yaw(x)
            excess, (gradient, hessian) = limits.excess(yaw), self._gradient_and_hessian(yaw)
            at, which = np.nonzero(excess > -ACTIVE_DISTANCE)
            slopes = limits.slopes(yaw)[:, at, which]
            linear = sum(slope[:, None] * each[at] for slope, each in zip(slopes, self._rows, strict=True))
            near = excess[at, which]
            room = np.where(near > 0.0, -RESTORED * near, -near)
            far = np.where(is_yaw, reach, inf)
            step = quadratic_minimum(hessian, gradient, far, linear, room)
            if step is None:
                step = quadratic_minimum(hessian, gradient, far, linear, np.maximum(room, 0.0))
            if step is None:
                break
            tried = self._rank(x + step)
            if tried < rank:
                gained = rank[0] > tried[0] or rank[1] - tried[1] > MIN_DECREASE * rank[1]
                x, rank, reach = x + step, tried, 2.0 * reach
            else:
                gained, reach = True, min(reach, float(np.abs(step[is_yaw]).max(initial=0.0))) / 4.0
            if not gained or reach < LEAST_REACH:
                break
        return x
