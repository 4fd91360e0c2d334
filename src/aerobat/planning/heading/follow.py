"""The yaw that follows a heading as closely as the rotors allow, beside a path that stays as it is.

The yaw is a spline. It minimizes the squared distance from what is asked, weighed by how much that is asked,
beside a little of its third derivative, within all limits along the path. The programs are quadratic, one
after another, each about the last yaw; one of the yaws that they begin at keeps all limits: no turn at all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import degrees, inf

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.errors import Infeasible, Reason
from aerobat.optimization.quadratic import quadratic_minimum
from aerobat.planning.heading.yaw_limits import ORDERS, YawLimits
from aerobat.planning.heading.yaw_spline import PER_KNOT, YawSpline
from aerobat.planning.result import Plan
from aerobat.planning.task import Task
from aerobat.problem.heading import Heading, HeadingMode
from aerobat.states import FlatState

SHARE = 0.5  # of the reserve that the path keeps for the controller, which turning leaves to it
# of each part, where limits are looked at: off its knots, and closer beside them, where limits are steep
PLACES = 0.5 - 0.5 * np.cos(np.pi * np.array([0.006, *np.arange(1, 8) / 8, 0.994]))
SPANS = np.diff(0.5 * (PLACES[1:] + PLACES[:-1]), prepend=0.0, append=1.0)  # of it, which these stand for
SMOOTH = 1e-6  # [s⁶] of the third derivative's square: what is asked faster than some 10 rad/s is rounded
ASKED = 0.3  # [-] of full weight from which on what is asked counts
AT_ITS_END = 0.5  # of its size, how near to its end a limit may be to matter to a step
SLACK = 1e-3  # of its size, by which a sampled limit may be exceeded
REACH, LEAST_REACH = 0.6, 2e-3  # [rad] of a step at first, and of the last
ROUNDS = 60
SMOOTHER = (1.0, 30.0, 1000.0)  # times as smooth as need be, where a search begins
PART = 0.4  # of the smoother ones of these turns, where it begins too: whole ones may be too far off limits
RESTORED = 0.5  # of what is exceeded, that a step takes away
ENOUGH = 1e-4  # of the cost, that a step has to gain
# what is kept more of limits' sizes, and how much of the turn is left, where a certificate refutes samples
WHOLE = tuple((more, 1.0) for more in (0.0, 0.005, 0.01, 0.02, 0.04, 0.08))
TRIES = (*WHOLE, (0.08, 0.6), (0.08, 0.3), (0.08, 0.0))


def with_heading(plan: Plan, reserve: float) -> Plan:
    """Return a plan whose body follows its problem's heading; itself where that is free.

    The first turn is taken that leaves the rotors SHARE of the reserve, else the first that is certified.
    Raises Infeasible where the heading's tolerance is not kept.

    Args:
        plan: Of a path alone.
        reserve: That the path keeps of its limits.
    """
    heading = plan.problem.heading
    if heading.mode is HeadingMode.FREE or plan.vehicle is None:
        return plan
    spline, tried = YawSpline.along(plan.trajectory), []
    for more, left in TRIES:
        task = Task.of(plan.problem, plan.vehicle, SHARE * reserve + more)
        found = _turned(plan, spline, _YawProgram(task, heading, spline).best(left))
        if found.keeps(SHARE * reserve) or not plan.certified:
            break
        tried.append(found)
    else:
        found = next((each for each in tried if each.certified), found)
    if plan.certified and not found.certified:
        why = "" if found.certificate is None else found.certificate.why
        sentence = f"no turn is proven that follows the heading: {why}; leave more with --reserve"
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


@dataclass(frozen=True)
class HeadingError:
    """The distance of a plan's heading from what is asked, where that is asked."""

    largest: float  # [rad]
    time: float  # [s] of that
    median: float  # [rad]


def heading_error(plan: Plan) -> HeadingError | None:
    """The distance of a plan's heading from what its problem asks; None where that is free or never asked."""
    heading = plan.problem.heading
    if heading.mode is HeadingMode.FREE or plan.vehicle is None:
        return None
    times = YawSpline.along(plan.trajectory).times(PLACES)
    limits = YawLimits(Task.of(plan.problem, plan.vehicle), plan.trajectory, times)
    angle, weight = _asked(heading, limits)
    off = np.where(weight >= ASKED, np.abs(angle), -inf)
    if off.max() < 0.0:
        return None
    worst = int(off.argmax())
    return HeadingError(float(off[worst]), float(times[worst]), float(np.median(off[off >= 0.0])))


def _turned(plan: Plan, spline: YawSpline, variables: Array) -> Plan:
    """The plan with a yaw, whose knots are the path's too."""
    parts, is_cut = spline.last_parts, len(spline.seconds) > plan.trajectory.segments
    stages = tuple(replace(stage, interval=int(parts[stage.interval])) for stage in plan.stages)
    dt = None if is_cut else plan.dt
    return replace(plan, trajectory=spline.with_yaw(variables), stages=stages, dt=dt)


def _asked(heading: Heading, limits: YawLimits) -> tuple[Array, Array]:
    """The angle [rad] from the body's x axis to what is asked, about the thrust, and its weight, (m,)."""
    setpoint, duration = limits.carried, limits.path.duration
    axes = so3.axes(setpoint.q_world_body)
    flat: FlatState = setpoint.flat
    wanted = heading.reference_axes(limits.times / duration, flat, axes[..., 2])
    x, y = (np.sum(wanted * axes[..., k], axis=-1) for k in (0, 1))
    return np.arctan2(y, x), np.hypot(x, y)


@dataclass(frozen=True, eq=False)
class _YawProgram:
    """The quadratic programs that find a yaw, in the variables that the ends of the path leave free."""

    task: Task
    heading: Heading
    spline: YawSpline

    def best(self, left: float) -> Array:
        """All variables of the best yaw that is found, of whose turns a part is left."""
        free, added = self._ends
        found = [self._improved(start) for start in self._starts()]
        return np.asarray(free @ min(found, key=self._rank) * left + added)

    @cached_property
    def _limits(self) -> YawLimits:
        """Limits at the places of the spline."""
        return YawLimits(self.task, self.spline.cut_path, self.spline.times(PLACES))

    @cached_property
    def _target(self) -> tuple[Array, Array]:
        """The yaw that is asked [rad], without jumps, and how much it is, (m,) each."""
        angle, weight = _asked(self.heading, self._limits)
        known = np.flatnonzero(weight >= ASKED)
        if not len(known):
            return np.zeros_like(angle), np.zeros_like(weight)
        steady = np.interp(np.arange(len(angle)), known, np.unwrap(angle[known]))
        steady -= 2 * np.pi * np.round(steady[0] / (2 * np.pi))
        return steady, np.where(weight >= ASKED, weight, 0.0)

    @cached_property
    def _ends(self) -> tuple[Array, Array]:
        """From the free variables (v,) to all of them: a matrix (n, v), and what is added, (n,)."""
        count = PER_KNOT * (len(self.spline.seconds) + 1)
        every, added = np.eye(count), np.zeros(count)
        if not self.task.stages.closed:  # it begins as the heading starts, and ends still
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
        """The yaw and its derivatives at the places by the free variables, (m, v) each."""
        return [self.spline.rows(PLACES, k) @ self._ends[0] for k in range(ORDERS)]

    @cached_property
    def _fixed(self) -> Array:
        """The part of them that is fixed, (4, m)."""
        return np.array([self.spline.rows(PLACES, k) @ self._ends[1] for k in range(ORDERS)])

    @cached_property
    def _pull(self) -> Array:
        """The weights of squared distances from what is asked [s], (m,)."""
        return np.asarray(self._target[1] ** 2 * self._seconds)

    @cached_property
    def _seconds(self) -> Array:
        """The time that each place stands for [s], (m,)."""
        return np.outer(self.spline.seconds, SPANS).ravel()

    def _yaw(self, x: Array) -> Array:
        """The yaw and its derivatives, (4, m)."""
        return np.array([each @ x for each in self._rows]) + self._fixed

    def _slopes(self, yaw: Array, smooth: float = SMOOTH) -> tuple[Array, Array]:
        """The cost's gradient (v,) and Hessian (v, v)."""
        bend, (value, *_, third) = smooth * self._seconds, self._rows
        hessian = (value.T * self._pull) @ value + (third.T * bend) @ third
        hessian += 1e-9 * np.trace(hessian) / len(hessian) * np.eye(len(hessian))
        off = self._pull * (yaw[0] - self._target[0])
        return value.T @ off + third.T @ (bend * yaw[3]), hessian

    def _starts(self) -> list[Array]:
        """No turn; what would be followed without limits, the smoother the less; parts of the smoother."""
        still = np.zeros(self._ends[0].shape[1])
        slopes = [self._slopes(self._yaw(still), SMOOTH * more) for more in SMOOTHER]
        whole = [np.asarray(-np.linalg.solve(hessian, gradient)) for gradient, hessian in slopes]
        return [still, *whole, *(PART * turn for turn in whole[1:])]

    def _rank(self, x: Array) -> tuple[float, float]:
        """By how much limits are exceeded, slack aside, and the cost."""
        yaw = self._yaw(x)
        off = self._pull @ (yaw[0] - self._target[0]) ** 2
        exceeded = float(self._limits.excess(yaw).max())
        return max(exceeded, SLACK), float(off + SMOOTH * self._seconds @ yaw[3] ** 2)

    def _improved(self, x: Array) -> Array:
        """A better yaw near another: first within the limits, then cheaper."""
        (free, _), limits, reach = self._ends, self._limits, REACH
        is_yaw = np.tile(np.arange(PER_KNOT) == 0, len(free) // PER_KNOT) @ free > 0.0
        rank = self._rank(x)
        for _ in range(ROUNDS):
            yaw = self._yaw(x)
            excess, (gradient, hessian) = limits.excess(yaw), self._slopes(yaw)
            at, which = np.nonzero(excess > -AT_ITS_END)
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
                gained = rank[0] > tried[0] or rank[1] - tried[1] > ENOUGH * rank[1]
                x, rank, reach = x + step, tried, 2.0 * reach
            else:
                gained, reach = True, min(reach, float(np.abs(step[is_yaw]).max(initial=0.0))) / 4.0
            if not gained or reach < LEAST_REACH:
                break
        return x
