"""Derivatives that a problem fixes at the knots of a polynomial path, and first guesses of knot times."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import filterfalse, pairwise
from math import isfinite, sqrt

import numpy as np

from aerobat.arrays import Array
from aerobat.errors import Reason
from aerobat.planning.task import Task
from aerobat.problem.condition import Condition, ForceBalance, Quantity
from aerobat.problem.problem import Problem
from aerobat.problem.stage import Stage
from aerobat.trajectory import Trajectory

LEG_THRUST_FRACTION = 0.3  # fraction of the specific thrust that accelerates a leg when times are guessed
SHORTEST_LEG = 0.2  # least guessed duration of a leg [s]
STAGE_TOLERANCE = 1e-6  # violation of a condition that is rounding, in SI units


def fixed_at_knots(task: Task, order: int, velocities: Array) -> Array:
    """Return position and its derivatives below `order` at start, stages and goal, (K, order, 3); NaN: free.

    The closed form treats each axis alone and takes equalities only. So conditions in oblique directions fix
    every component that they contain, by least norm. Balls, gates and ranges of positions are met at their
    centres. An attitude fixes the direction of thrust exactly. A lower bound on thrust fixes the thrust at
    the larger of the bound and hover thrust. A lower bound on speed fixes the speed at the larger of the
    bound and the given velocity. Other inequalities are left free, to be checked afterwards.

    Args:
        task: The task whose ends and stages are fixed.
        order: Number of derivatives, position included.
        velocities: Velocities at the stages for the drag [m/s], (K - 2, 3).
    """
    problem, stages = task.problem, task.stages.stages
    fixed = np.full((len(stages) + 2, order, 3), np.nan)
    met = problem.goal.fixed(order)
    fixed[0], fixed[-1, met] = problem.start.derivatives(order), problem.goal.derivatives(order)[met]
    for knot, (stage, velocity) in enumerate(zip(stages, velocities, strict=True), 1):
        fixed[knot, 0] = position_at_knot(stage, task)
        for derivative in (1, 2):
            fixed[knot, derivative] = _fixed(stage, derivative, task.balance, velocity)
    return fixed


def position_at_knot(stage: Stage, task: Task) -> Array:
    """Return the position [m] of `fixed_at_knots` at a stage, NaN where it is free, (3,)."""
    centre = stage.centre(task.problem.gates)
    return _fixed(stage, 0, task.balance, np.zeros(3)) if centre is None else centre


def stages_with_drag(task: Task) -> list[int]:
    """Return the numbers of the stages whose fixed derivatives may depend on velocities through the drag."""
    if task.balance.drag == 0.0:
        return []
    return [
        number
        for number, stage in enumerate(task.stages.stages)
        if stage.attitude is not None or any(c.quantity is not Quantity.POSITION for c in stage.conditions)
    ]


def first_times(problem: Problem, fixed: Array, max_specific_thrust: float) -> Array:
    """Return initial durations between knots [s], (K - 1,): the problem's own, or a guess from distances."""
    if problem.maneuver.first_times is not None:
        return np.diff([0.0, *problem.maneuver.first_times])
    placed = np.flatnonzero(~np.isnan(fixed[:, 0]).any(axis=1))
    durations = np.empty(len(fixed) - 1)
    for a, b in pairwise(placed.tolist()):
        length = float(np.linalg.norm(fixed[b, 0] - fixed[a, 0]))
        leg = max(2.0 * sqrt(length / (LEG_THRUST_FRACTION * max_specific_thrust)), SHORTEST_LEG)
        durations[a:b] = leg / (b - a)
    return durations


def without_speed_bounds(task: Task) -> Task:
    """Return the task without lower bounds on speed at stages that ask no attitude."""
    stages = (
        stage
        if stage.attitude
        else replace(stage, conditions=tuple(filterfalse(_is_speed_bound, stage.conditions)))
        for stage in task.stages.stages
    )
    return task.with_stages(stages)


def violated_stage(task: Task, trajectory: Trajectory) -> Reason | None:
    """Return a sentence about the first stage missed by a trajectory with a knot at each stage, or None."""
    values = [trajectory.evaluate(trajectory.knots[1:-1], k) for k in range(3)]
    fractions = trajectory.knots[1:-1] / trajectory.duration
    for stage, flat, fraction in zip(task.stages.stages, np.stack(values, axis=1), fractions, strict=True):
        for condition in stage.conditions:
            bound = condition.bound(task.balance)
            value = float(bound.value(flat))
            if bound.excess(flat) > STAGE_TOLERANCE:
                given = f"{condition.name} {condition.range}, the closed form gives {value:.4g}"
                return Reason(f"the stage '{stage.name}' asks {given}", (f"stage '{stage.name}'",))
        earliest, latest = stage.window
        if not earliest - STAGE_TOLERANCE <= fraction <= latest + STAGE_TOLERANCE:
            given = f"between {earliest:.4g} and {latest:.4g} of the duration, the closed form passes it"
            sentence = f"the stage '{stage.name}' asks to be passed {given} at {fraction:.4g}"
            return Reason(sentence, (f"stage '{stage.name}'",))
    return None


def _is_speed_bound(condition: Condition) -> bool:
    """Return whether a condition is a lower bound on speed."""
    return condition.quantity is Quantity.VELOCITY and 0.0 < condition.lower < condition.upper


def _fixed(stage: Stage, derivative: int, balance: ForceBalance, velocity: Array) -> Array:
    """Return the components (3,) of one derivative that a stage fixes; NaN: free."""
    rows = list(_equalities(stage, derivative, balance, velocity))
    if not rows:
        return np.full(3, np.nan)
    directions = np.array([direction for direction, _ in rows])
    solution = np.linalg.lstsq(directions, np.array([value for _, value in rows]), rcond=None)[0]
    return np.where(directions.any(axis=0), solution, np.nan)


def _equalities(
    stage: Stage, derivative: int, balance: ForceBalance, velocity: Array
) -> Iterator[tuple[Array, float]]:
    """Yield the directions in which a stage fixes one derivative, and the values, at a velocity."""
    if stage.attitude is not None and derivative == Quantity.SPECIFIC_THRUST.derivative:
        thrust = max(stage.attitude.min_thrust, balance.gravity) * stage.attitude.up
        yield from zip(np.eye(3), thrust - balance.constant - balance.drag * velocity, strict=True)
        return
    for condition in stage.conditions:
        if condition.quantity.derivative != derivative:
            continue
        value = condition.lower
        if condition.min_thrust > 0.0 and condition.lower < condition.upper:
            hover = balance.gravity * float(np.linalg.norm(condition.direction))
            value = float(np.clip(hover, condition.lower, condition.upper))
        elif condition.quantity is Quantity.VELOCITY and 0.0 < condition.lower < condition.upper:
            value = min(max(value, float(condition.direction @ velocity)), condition.upper)
        elif condition.quantity is Quantity.POSITION and isfinite(condition.upper - condition.lower):
            value = 0.5 * (condition.lower + condition.upper)
        elif condition.lower < condition.upper:
            continue
        bound = condition.bound(balance)
        drag = float(bound.weights[1] @ velocity) if derivative == 2 else 0.0
        yield condition.direction, value - bound.constant - drag
