"""A planning task: everything that is asked of a path, said once, for every planner and for the judge."""

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

# without a vehicle, stages that ask a fraction of its thrust assume what a hexarotor in the paper's class has
ASSUMED_THRUST_TO_WEIGHT = 5.0
SHARE = 0.5  # of the room that a narrow passage leaves to the body, which is kept clear
KEPT_INSIDE = 0.1  # of a ball's radius, at most, from its surface: flights under lab stray by half of that
RATES = {Quantity.POSITION: Quantity.VELOCITY, Quantity.VELOCITY: Quantity.ACCELERATION}
ROUNDING = 1e-9  # of a limit, or of a direction: what is nearer is the same
LEAST_CLEARANCE = 0.001  # [m] that is kept clear in the narrowest: what lies between places is within it


@dataclass(frozen=True)
class Task:
    """Ends, stages in order, and limits that hold throughout, for one vehicle in one environment.

    Ends, limits per axis and the environment are the problem's. The stages are what the problem asks of the
    vehicle, or what a planner makes of that where it asks less for a start.
    """

    problem: Problem
    vehicle_if_any: Vehicle | None
    stages: StageSequence
    reserve: float = 0.0  # of the vehicle's limits' ranges, kept from either end; proven of rotors
    clearance: float = 0.0  # [m] kept from obstacles, and inside balls

    @classmethod
    def of(
        cls, problem: Problem, vehicle: Vehicle | None = None, reserve: float = 0.0, clearance: float = 0.0
    ) -> Task:
        """Return what a problem asks of a vehicle, or of none, with no more clearance than ends leave.

        Args:
            problem: Its stages are made for the vehicle's thrust and size.
            vehicle: What shall fly.
            reserve: Kept for the controller.
            clearance: Kept from obstacles for it [m].
        """
        body_radius = 0.0 if vehicle is None else vehicle.body_radius
        stages = problem.stages(max_specific_thrust(problem, vehicle), body_radius)
        inside = (_well_inside(stage, clearance) for stage in stages.stages)
        stages = replace(stages, stages=tuple(_at_limits(stage, problem.path_limits) for stage in inside))
        asked = cls(problem, vehicle, stages, reserve, clearance)
        if vehicle is None or not clearance or not problem.surroundings.obstacles:
            return asked
        left = min(gaps_at_ends(problem, vehicle)[0], default=inf)
        return asked if left > clearance else asked.with_room(left)

    def with_room(self, room: float) -> Task:
        """Return the same, with no more clearance than is left where there is little room [m]."""
        return replace(self, clearance=min(self.clearance, max(SHARE * room, LEAST_CLEARANCE)))

    def with_stages(self, stages: Iterable[Stage]) -> Task:
        """Return the same with other stages, in order or not as before."""
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
        """The task that a plan's evidence is about: every limit used in full, nothing more kept clear."""
        return Task.of(self.problem, self.vehicle_if_any)

    @cached_property
    def balance(self) -> ForceBalance:
        """The balance of thrust, acceleration and drag."""
        return force_balance(self.environment, self.vehicle_if_any)

    @cached_property
    def limits(self) -> tuple[Limit, ...]:
        """Everything that must hold all along a path."""
        limits, conditions = self.problem.path_limits, self.stages.path_constraints
        return limits_along(self.vehicle_if_any, self.environment, limits, conditions)

    @cached_property
    def held(self) -> tuple[Limit, ...]:
        """The limits that imply all others along a whole path: those that an optimizer holds."""
        return tuple(limit for limit in self.limits if not limit.is_implied)

    def envelope(self, placed: Sequence[PlacedStage] = ()) -> Envelope:
        """Return what a certificate is about, gates and balls at placed stages among it."""
        return Envelope(
            limits=self.problem.path_limits,
            conditions=self.stages.path_constraints,
            passages=planned_passages(placed, self.problem),
            waypoints=planned_waypoints(placed, self.problem),
            start=self.problem.ends.get("start"),
            goal=self.problem.ends.get("goal"),
            closed=self.stages.closed,
        )


def _well_inside(stage: Stage, clearance: float) -> Stage:
    """The stage with a smaller ball, if it has one."""
    if stage.ball is None or not clearance:
        return stage
    kept = min(clearance, KEPT_INSIDE * stage.ball.radius)
    return replace(stage, ball=replace(stage.ball, radius=stage.ball.radius - kept))


def _at_limits(stage: Stage, limits: Limits) -> Stage:
    """The stage with all that follows where it asks the very limit: what is at its most stands still there.

    No path is within the limit and beyond it beside; who knows only inequalities finds none that is near.
    """
    conditions = list(stage.conditions)
    for place, asked in enumerate(stage.conditions):
        if asked.quantity not in RATES:
            continue
        used = asked.direction != 0.0
        ends = [asked.direction[used] * each[used] for each in limits.of(asked.quantity.derivative)]
        least, most = float(np.minimum(*ends).sum()), float(np.maximum(*ends).sum())
        reached = next(
            (end for bound, end in ((asked.lower, most), (asked.upper, least)) if _same(bound, end)), None
        )
        if reached is None:
            continue
        conditions[place] = replace(asked, lower=reached, upper=reached)
        if not any(_fixes(known, RATES[asked.quantity], asked.direction) for known in conditions):
            conditions.append(Condition(RATES[asked.quantity], asked.direction, lower=0.0, upper=0.0))
    return replace(stage, conditions=tuple(conditions))


def _same(bound: float, end: float) -> bool:
    """True of a bound at a limit's finite end."""
    return bool(isfinite(end) and abs(bound - end) <= ROUNDING * max(abs(end), 1.0))


def _fixes(condition: Condition, quantity: Quantity, direction: Array) -> bool:
    """True of a condition that fixes a quantity along a direction."""
    across = np.linalg.norm(np.cross(condition.direction, direction))
    parallel = across <= ROUNDING * np.linalg.norm(condition.direction) * np.linalg.norm(direction)
    return bool(condition.quantity is quantity and condition.lower == condition.upper and parallel)


def max_specific_thrust(problem: Problem, vehicle: Vehicle | None) -> float:
    """Return the thrust over mass [m/s²] that stages may ask: a vehicle's, or what is assumed without one."""
    if vehicle is None:
        return ASSUMED_THRUST_TO_WEIGHT * problem.environment.gravity
    return vehicle.max_specific_thrust
