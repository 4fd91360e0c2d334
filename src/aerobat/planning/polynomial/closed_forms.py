"""Closed forms as starts of refinements: paths through a task's stages, and laps of closed courses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import filterfalse, product

import numpy as np

from aerobat.planning.polynomial.knots import (
    first_times,
    fixed_at_knots,
    position_at_knot,
    without_speed_bounds,
)
from aerobat.planning.rotor_margin import sampled_margin
from aerobat.planning.task import Task
from aerobat.planning.warm_start import WarmStart
from aerobat.problem.condition import Condition, Quantity, fixed
from aerobat.problem.end_state import at_rest
from aerobat.problem.maneuvers.line import Line
from aerobat.problem.problem import Problem
from aerobat.problem.stage import Stage
from aerobat.trajectory import Trajectory
from aerobat.trajectory.minimum_effort import minimum_effort

ORDERS = (4, 3)  # orders of the closed forms that start courses: minimum snap, minimum jerk
SLOWER_PACES = (1.3, 1.7)  # factors on their durations where faster starts fail or paths touch a frame
UNROLLED = 3  # laps in a row; the middle one is a flying lap
# by how much a stretched path may exceed rotor limits, as a fraction of the rotors' range
ALLOWED_EXCESS = 0.3
PACE = 1.05  # factor on the duration in one step of stretching
PACES = 80  # largest number of steps: 50 times the duration
FIGURE_PACES = 12  # the same for figures, 1.8 times: slow motions reach their attitudes only in free fall
PACE_STRIDE = 4  # steps at a time where no pace is close enough and the one closest to the limits is taken
MIN_GATE_SPEED = 3.0  # least speed of starts through gates [m/s]


def closed_forms(task: Task, paces: Sequence[float] = (1.0,)) -> Iterator[tuple[None, WarmStart]]:
    """Yield closed forms through a course with their durations scaled by each of `paces`; none is a plan."""
    closed_form = flying_lap if task.stages.closed else start_along_normals
    for pace, order in product(paces, ORDERS):
        yield None, closed_form(task, order).time_scaled(pace)


def flying_lap(task: Task, order: int) -> WarmStart:
    """Return a flying lap of the closed form through a closed sequence: the middle one of three in a row.

    The three laps begin at rest at the last position and end at rest at the first. The seam between laps
    lies half-way in time between those two positions.

    Args:
        task: A task with a closed course.
        order: The derivative of position whose square is minimized.
    """
    problem, sequence = task.problem, task.stages
    positions = [position_at_knot(stage, task) for stage in sequence.stages]
    places = [position for position in positions if not np.isnan(position).any()] or [np.zeros(3)]
    lap = (Stage("seam"), *sequence.stages)
    laps = replace(sequence, stages=(*UNROLLED * lap, Stage("seam")), closed=False)
    open_ends = replace(problem, maneuver=Line(), start=at_rest(places[-1]), goal=at_rest(places[0]))
    path = start_along_normals(replace(task, problem=open_ends, stages=laps), order).trajectory
    first = 1 + len(lap) * (UNROLLED // 2)  # the knot at which the middle lap begins
    segments = slice(first, first + len(lap))
    middle = Trajectory(path.durations[segments], path.coefficients[segments], problem.heading.start)
    return WarmStart(middle, sequence.stages, tuple(middle.knots[1:-1].tolist()))


def start_along_normals(task: Task, order: int) -> WarmStart:
    """Return the stretched closed form through ordered stages that passes gates along their normals.

    The speed in a gate is that of the closed form with free velocities, at least MIN_GATE_SPEED.

    Args:
        task: The task whose ends are met and whose gates are passed.
        order: The derivative of position whose square is minimized.
    """
    path = stretched_path(task, order)
    if any(stage.gate is not None for stage in task.stages.stages):
        speeds = np.linalg.norm(path.evaluate(path.knots[1:-1], 1), axis=-1).tolist()
        pairs = zip(task.stages.stages, speeds, strict=True)
        stages = (_along_normal(stage, task.problem, max(speed, MIN_GATE_SPEED)) for stage, speed in pairs)
        path = stretched_path(task.with_stages(stages), order)
    return WarmStart(path, task.stages.stages, tuple(path.knots[1:-1].tolist()))


def _along_normal(stage: Stage, problem: Problem, speed: float) -> Stage:
    """Return a stage with its velocity [m/s] fixed along its gate's normal; itself without a gate."""
    if stage.gate is None:
        return stage
    conditions = fixed(Quantity.VELOCITY, speed * problem.gate(stage.gate).normal)
    return replace(stage, conditions=(*stage.conditions, *conditions))


def stretched_path(task: Task, order: int) -> Trajectory:
    """Return the closed form through ordered stages for warm starts; legs last as the roots of their lengths.

    The path is stretched in time until rotors exceed their limits by ALLOWED_EXCESS at most: a motion that is
    a little too fast is nearer to the optimum than one that is too slow. Slow motions cannot fly figures:
    where no pace tried satisfies that, the pace that exceeds limits least is taken.

    Args:
        task: The task whose ends and stages are met, without the attitudes of figures, which follow from
            their positions.
        order: The derivative of position whose square is minimized.
    """
    vehicle, still = task.vehicle, np.zeros((len(task.stages.stages), 3))
    fixed = fixed_at_knots(_without_figures_attitudes(without_speed_bounds(task)), order, still)
    durations = first_times(task.problem, fixed, vehicle.max_specific_thrust)
    allowed = -ALLOWED_EXCESS * float(vehicle.thrust_ranges.max())
    paces = FIGURE_PACES if any(map(_is_of_figure, task.stages.stages)) else PACES

    def path(steps: int) -> Trajectory:
        return minimum_effort(fixed, durations * PACE**steps, heading=task.problem.heading.start)

    def margin(steps: int) -> float:
        return float(sampled_margin(path(steps), vehicle, task.environment).margin)

    slower = next((steps for steps in range(paces) if margin(steps) >= allowed), None)
    if slower is None:
        return path(max(range(-2 * paces, paces, PACE_STRIDE), key=margin))
    if slower > 0:
        return path(slower)
    return path(1 - next((steps for steps in range(1, PACES) if margin(-steps) < allowed), PACES))


def _without_figures_attitudes(task: Task) -> Task:
    """Return the task without the attitudes of figures' stages whose position is given."""
    stages = (
        replace(stage, attitude=None, conditions=tuple(filterfalse(_is_of_thrust, stage.conditions)))
        if _is_of_figure(stage) and stage.is_placed
        else stage
        for stage in task.stages.stages
    )
    return task.with_stages(stages)


def _is_of_figure(stage: Stage) -> bool:
    """Return whether a stage asks an attitude and has no gate, as in a figure such as a flip."""
    return stage.gate is None and stage.attitude is not None


def _is_of_thrust(condition: Condition) -> bool:
    return condition.quantity is Quantity.SPECIFIC_THRUST
