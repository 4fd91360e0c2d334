"""A planning task: all requirements on a path, in one place for every planner and for the certificate."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, isfinite

import numpy as np

from aerobat.arrays import Array
from aerobat.certification.envelope import Envelope
from aerobat.environment import Environment
from aerobat.flatness import force_balance
from aerobat.limits.along import limits_along
from aerobat.limits.limit import Limit
from aerobat.planning.passages import PlacedStage, gaps_at_ends, planned_passages, planned_waypoints
from aerobat.problem.condition import Condition, ForceBalance, Quantity
from aerobat.problem.limits import Limits
from aerobat.problem.problem import Problem
from aerobat.problem.stage import Stage, StageSequence
from aerobat.vehicle import Vehicle

# thrust-to-weight ratio assumed without a vehicle, where stages ask a fraction of its thrust: that of a
# hexarotor of the paper's class
ASSUMED_THRUST_TO_WEIGHT = 5.0
CLEARANCE_FRACTION = 0.5  # fraction of the room in a narrow passage that is kept as clearance
# largest reduction of a ball's radius, relative: lab flights have errors of half of that
MAX_BALL_REDUCTION = 0.1
RATES = {Quantity.POSITION: Quantity.VELOCITY, Quantity.VELOCITY: Quantity.ACCELERATION}
ROUNDING = 1e-9  # relative difference of limits or directions below which they are equal
LEAST_CLEARANCE = 0.001  # least clearance [m]; covers violations between the places of a program


@dataclass(frozen=True)
class Task:
    """Ends, stages in order, and limits along the path, for one vehicle in one environment.

    Ends, limits per axis and the environment are the problem's. The stages are those of the problem for the
    vehicle. Planners may relax the stages, to find a start.
    """

    problem: Problem
    vehicle_if_any: Vehicle | None
    stages: StageSequence
    reserve: float = 0.0  # fraction of the vehicle's limits' ranges kept from either end; proven for rotors
    clearance: float = 0.0  # [m] kept from obstacles, and inside balls

    @classmethod
    def of(
        cls, problem: Problem, vehicle: Vehicle | None = None, reserve: float = 0.0, clearance: float = 0.0
    ) -> Task:
        """Return the task of a problem, with or without a vehicle; the ends may reduce its clearance.

        Args:
            problem: The problem, whose stages depend on the vehicle's thrust and size.
            vehicle: The vehicle, if any.
            reserve: Fraction of the limits' ranges kept for the controller.
            clearance: Distance kept from obstacles for the controller [m].
        """
        body_radius = 0.0 if vehicle is None else vehicle.body_radius
        stages = problem.stages(max_specific_thrust(problem, vehicle), body_radius)
        inside = (_with_smaller_ball(stage, clearance) for stage in stages.stages)
        stages = replace(stages, stages=tuple(_at_limits(stage, problem.path_limits) for stage in inside))
        task = cls(problem, vehicle, stages, reserve, clearance)
        if vehicle is None or not clearance or not problem.surroundings.obstacles:
            return task
        left = min(gaps_at_ends(problem, vehicle)[0], default=inf)
        return task if left > clearance else task.with_room(left)

    def with_room(self, room: float) -> Task:
        """Return the task with its clearance reduced to a fraction of `room` [m], where that is less."""
        return replace(self, clearance=min(self.clearance, max(CLEARANCE_FRACTION * room, LEAST_CLEARANCE)))

    def with_stages(self, stages: Iterable[Stage]) -> Task:
        """Return the task with other stages, which are ordered if the present ones are."""
        return replace(self, stages=replace(self.stages, stages=tuple(stages)))

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle of a task that has one."""
        assert self.vehicle_if_any is not None, "only tasks with a vehicle are asked for it"
        return self.vehicle_if_any

    @property
    def environment(self) -> Environment:
        """Gravity, wind, ground and obstacles, the walls of gates among them."""
        return self.problem.surroundings

    @cached_property
    def as_proven(self) -> Task:
        """The task that a plan's evidence is about: without reserve and without clearance."""
        return Task.of(self.problem, self.vehicle_if_any)

    @cached_property
    def balance(self) -> ForceBalance:
        """The balance of thrust, acceleration and drag."""
        return force_balance(self.environment, self.vehicle_if_any)

    @cached_property
    def limits(self) -> tuple[Limit, ...]:
        """All limits along the path."""
        limits, conditions = self.problem.path_limits, self.stages.path_constraints
        return limits_along(self.vehicle_if_any, self.environment, limits, conditions)

    @cached_property
    def held(self) -> tuple[Limit, ...]:
        """The limits along the path without those that others imply, for optimizers."""
        return tuple(limit for limit in self.limits if not limit.is_implied)

    def envelope(self, placed: Sequence[PlacedStage] = ()) -> Envelope:
        """Return the conditions that a certificate proves, including gates and balls at placed stages."""
        return Envelope(
            limits=self.problem.path_limits,
            conditions=self.stages.path_constraints,
            passages=planned_passages(placed, self.problem),
            waypoints=planned_waypoints(placed, self.problem),
            start=self.problem.ends.get("start"),
            goal=self.problem.ends.get("goal"),
            closed=self.stages.closed,
        )


def _with_smaller_ball(stage: Stage, clearance: float) -> Stage:
    """Return the stage with a smaller ball, if it has one."""
    if stage.ball is None or not clearance:
        return stage
    kept = min(clearance, MAX_BALL_REDUCTION * stage.ball.radius)
    return replace(stage, ball=replace(stage.ball, radius=stage.ball.radius - kept))


def _at_limits(stage: Stage, limits: Limits) -> Stage:
    """Return the stage with equality conditions where it asks a value at the very limit.

    A quantity at its limit has an extremum there, so that its derivative is zero. Solvers that see only the
    inequalities find no path near such a stage.
    """
    conditions = list(stage.conditions)
    for place, condition in enumerate(stage.conditions):
        if condition.quantity not in RATES:
            continue
        used = condition.direction != 0.0
        ends = [condition.direction[used] * each[used] for each in limits.of(condition.quantity.derivative)]
        least, most = float(np.minimum(*ends).sum()), float(np.maximum(*ends).sum())
        reached = next(
            (end for bound, end in ((condition.lower, most), (condition.upper, least)) if _same(bound, end)),
            None,
        )
        if reached is None:
            continue
        conditions[place] = replace(condition, lower=reached, upper=reached)
        if not any(_fixes(known, RATES[condition.quantity], condition.direction) for known in conditions):
            conditions.append(Condition(RATES[condition.quantity], condition.direction, lower=0.0, upper=0.0))
    return replace(stage, conditions=tuple(conditions))


def _same(bound: float, end: float) -> bool:
    """Return whether a bound lies at a limit's finite end."""
    return bool(isfinite(end) and abs(bound - end) <= ROUNDING * max(abs(end), 1.0))


def _fixes(condition: Condition, quantity: Quantity, direction: Array) -> bool:
    """Return whether a condition fixes a quantity along a direction."""
    across = np.linalg.norm(np.cross(condition.direction, direction))
    parallel = across <= ROUNDING * np.linalg.norm(condition.direction) * np.linalg.norm(direction)
    return bool(condition.quantity is quantity and condition.lower == condition.upper and parallel)


def max_specific_thrust(problem: Problem, vehicle: Vehicle | None) -> float:
    """Return the largest specific thrust [m/s²] that stages may ask, an assumed one without a vehicle."""
    if vehicle is None:
        return ASSUMED_THRUST_TO_WEIGHT * problem.environment.gravity
    return vehicle.max_specific_thrust
