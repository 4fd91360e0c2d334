"""A lower bound on the duration of any motion that solves a problem, by physics alone, in milliseconds.

The derivation is in docs/theory.md, section 13. Two relaxations give the bound. Along each of a few
directions the vehicle is a point with bounded thrust and linear drag, which comes to rest wherever it
reverses. And the thrust axis has to turn from each stage's attitude to the next one's. Everything that the
relaxations leave out could only take longer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from math import inf, pi, sqrt

import numpy as np

from aerobat.arrays import Array
from aerobat.flatness.inverse_dynamics import axial_drag, force_balance
from aerobat.planning.assessment.damped_point import DampedPoint
from aerobat.problem.condition import Condition, ForceBalance, Quantity
from aerobat.problem.end_state import EndState
from aerobat.problem.problem import Problem
from aerobat.problem.stage import Stage, StageSequence
from aerobat.so3 import UP
from aerobat.vehicle import Vehicle

PARALLEL = 1e-9  # distance from 1 of the cosine between two directions that count as one [-]
INSTANT_STOP = 1e9  # deceleration [m/s²] that stands for no need to stop, at a goal with free velocity
MANY_ROTORS = 12  # number of rotors above which moments are bounded axis by axis: vertices are too many
HALVINGS = 3  # bisections of the interval of durations, which bound the speed


def least_duration(problem: Problem, vehicle: Vehicle) -> float:
    """Return a lower bound on the duration [s] of any motion of the vehicle that solves the problem.

    Raises SpecError for gates that do not suit the maneuver.
    """
    sequence = problem.stages(vehicle.max_specific_thrust, vehicle.body_radius)
    lines = [_Line.of(problem, vehicle, sequence, n) for n in _directions(problem, sequence)]

    # [1/s] half the difference of drag along body x and y, over the mass; a specific thrust per airspeed
    across = abs(float(vehicle.drag_body[0] - vehicle.drag_body[1])) / 2.0 / vehicle.mass

    def moving(duration: float) -> float:
        speed = _max_airspeed(problem, vehicle, duration)
        thrust = vehicle.max_specific_thrust + (abs(axial_drag(vehicle)) + across) * speed
        return max(line.least_time(thrust, across * speed) for line in lines)

    longest = moving(0.0)
    equal = axial_drag(vehicle) == across == 0.0
    shortest = longest if equal else _least_consistent(moving, longest)
    rests = sum(stage.hold for stage in sequence.stages)
    return rests + max(shortest, _turning_time(problem, vehicle, sequence))


def _least_consistent(least: Callable[[float], float], longest: float) -> float:
    """Return a lower bound [s] on durations, where motions of duration T take `least(T)` or more.

    The function `least` decreases with T. So the bound is below the fixed point T = least(T).
    """
    shortest = least(longest)
    for _ in range(HALVINGS):
        middle = 0.5 * (shortest + longest)
        if (there := least(middle)) > middle:
            shortest = middle
        else:
            shortest, longest = max(shortest, there), middle
    return shortest


def _max_airspeed(problem: Problem, vehicle: Vehicle, duration: float) -> float:
    """Return an upper bound on the airspeed [m/s] within a duration.

    Drag only slows the vehicle, so thrust and weight bound the gain of airspeed. On a closed lap the mean
    velocity is zero. So each component is zero at some time, as at a start at rest.
    """
    environment = problem.environment
    pull = vehicle.max_specific_thrust + environment.gravity
    gained = float(np.linalg.norm(problem.start.velocity - environment.wind)) + pull * duration
    limited = float(np.linalg.norm(problem.limits.velocity) + np.linalg.norm(environment.wind))
    return min(gained, limited)


def _directions(problem: Problem, sequence: StageSequence) -> Iterator[Array]:
    """Yield the directions: the axes, those of conditions on position, and those between points to meet."""
    found = [*np.eye(3)]
    found += [c.direction for s in sequence.stages for c in s.conditions if c.quantity is Quantity.POSITION]
    balls = (stage.ball.centre for stage in sequence.stages if stage.ball is not None)
    places = [*(g.position for g in problem.gates), *balls]
    points = [problem.start.position, *places, problem.goal.position] if problem.ends else places
    found += [b - a for a, b in pairwise(points)]
    seen: list[Array] = []
    for vector in found:
        length = float(np.linalg.norm(vector))
        if length > 0.0 and not any(_along(vector, other) for other in seen):
            seen.append(vector / length)
            yield seen[-1]


def _along(vector: Array, direction: Array) -> float:
    """Return the factor by which a vector is a multiple of a unit vector; 0 where they are not parallel."""
    factor = float(vector @ direction)
    return factor if abs(factor) >= (1.0 - PARALLEL) * float(np.linalg.norm(vector)) else 0.0


@dataclass(frozen=True)
class _Place:
    """A position on a line that is met in its order; those with a side are reversals at zero speed."""

    side: int  # where a motion meets it: 1 at or beyond the position, −1 at or short of it, 0 there
    position: float  # [m]
    velocity: float = 0.0  # [m/s]
    is_passed: bool = False  # whether the velocity there is free, as at a goal with free velocity


@dataclass(frozen=True)
class _Line:
    """The relaxation of a problem along one direction."""

    groups: tuple[tuple[_Place, ...], ...]  # positions of start, each stage and goal; of a lap the stages'
    ordered: bool
    closed: bool
    lower: float  # [m/s²] lower bound of the specific thrust along the direction, all along the path
    upper: float  # [m/s²] its upper bound
    constant: float  # [m/s²] part of the specific thrust that balances weight and wind
    damping: float  # [1/s] drag over mass
    max_speed: float  # [m/s] along the direction, from the limits on velocity

    @classmethod
    def of(cls, problem: Problem, vehicle: Vehicle, sequence: StageSequence, direction: Array) -> _Line:
        """Return a problem's line along a direction, (3,)."""
        balance = force_balance(problem.environment, vehicle)
        lower, upper = _range(Quantity.SPECIFIC_THRUST, sequence.path_constraints, direction)
        crossed = np.flatnonzero(direction)
        speeds = np.asarray(problem.limits.velocity)[crossed]
        places = [_places(stage, direction) for stage in sequence.stages]
        ends = [
            (_Place(0, float(end.position @ direction), float(end.velocity @ direction), end.free_velocity),)
            for end in problem.ends.values()
        ]
        return cls(
            groups=(ends[0], *places, ends[1]) if ends else tuple(places),
            ordered=sequence.ordered,
            closed=sequence.closed,
            lower=lower,
            upper=upper,
            constant=float(balance.constant @ direction),
            damping=balance.drag,
            max_speed=float(np.abs(direction[crossed]) @ speeds),
        )

    def least_time(self, max_thrust: float, slack: float) -> float:
        """Return the largest lower bound [s] over sequences of positions that have to be met in order.

        Unordered stages are taken one at a time. Closed laps are taken from each position back to itself.

        Args:
            max_thrust: The largest specific thrust [m/s²].
            slack: By how much the bounds on specific thrust along the path are relaxed [m/s²].
        """
        forward = min(max_thrust, self.upper + slack) - self.constant
        backward = min(max_thrust, slack - self.lower) + self.constant
        up = DampedPoint(forward, backward, self.damping, self.max_speed)
        down = DampedPoint(backward, forward, self.damping, self.max_speed)
        return max((_longest(course, up, down) for course in self._courses()), default=0.0)

    def _courses(self) -> Iterator[Sequence[tuple[_Place, ...]]]:
        """Yield sequences of groups; a motion meets the positions of all groups, group after group."""
        if self.closed:
            for i, group in enumerate(self.groups):
                for place in group:
                    yield (place,), *self.groups[i + 1 :], *self.groups[:i], (place,)
            return
        start, *stages, goal = self.groups
        if self.ordered or not stages:
            yield self.groups
        else:
            yield from ((start, stage, goal) for stage in stages)


def _longest(groups: Sequence[Sequence[_Place]], up: DampedPoint, down: DampedPoint) -> float:
    """Return the largest lower bound [s] from the first group to the last, by way of positions between.

    Groups between may be skipped. This is the longest path through the groups, by dynamic programming.
    Reversals from which no longest path goes on are dropped, so that many stages cost little more than few.
    """
    longest = dict.fromkeys(groups[0], 0.0)
    for group in groups[1:]:
        reached = {
            place: max(time + _leg(before, place, up, down) for before, time in longest.items())
            for place in group
        }
        longest |= {place: max(time, longest.get(place, -inf)) for place, time in reached.items()}
        longest = dict(_not_surpassed(longest))
    return max(0.0, *reached.values())


def _not_surpassed(longest: dict[_Place, float]) -> Iterator[tuple[_Place, float]]:
    """Yield the positions with their times, without reversals from which another one goes farther and later.

    Motions go back from reversals, to the other side, for longer the farther the next one is.
    """
    farthest = {1: -inf, -1: -inf}
    for place, time in sorted(longest.items(), key=lambda item: item[1], reverse=True):
        if place.side:
            if place.side * place.position <= farthest[place.side]:
                continue
            farthest[place.side] = place.side * place.position
        yield place, time


def _leg(a: _Place, b: _Place, up: DampedPoint, down: DampedPoint) -> float:
    """Return the least time [s] from one position to another; -inf where they do not require that motion."""
    distance = b.position - a.position
    if b.is_passed:
        up, down = replace(up, backward=INSTANT_STOP), replace(down, backward=INSTANT_STOP)
    if distance == 0.0:
        return up.least_time(0.0, a.velocity, b.velocity) if a.side == b.side == 0 else -inf
    way, point = (1, up) if distance > 0.0 else (-1, down)
    if a.side == way or b.side == -way:
        return -inf
    return point.least_time(abs(distance), way * a.velocity, way * b.velocity)


def _places(stage: Stage, direction: Array) -> tuple[_Place, ...]:
    """Return the positions along a direction that a stage asks to be met; of a ball its two ends."""
    lower, upper = _range(Quantity.POSITION, stage.conditions, direction)
    slow, fast = _range(Quantity.VELOCITY, stage.conditions, direction)
    if stage.ball is not None:
        middle = float(stage.ball.centre @ direction)
        lower, upper = max(lower, middle - stage.ball.radius), min(upper, middle + stage.ball.radius)
    found = [_Place(1, lower), _Place(-1, upper)]
    if lower == upper and slow == fast:
        found.append(_Place(0, lower, slow))
    return tuple(place for place in found if abs(place.position) < inf)


def _range(quantity: Quantity, conditions: Sequence[Condition], direction: Array) -> tuple[float, float]:
    """Return the bounds that conditions set on a quantity along a direction."""
    lower, upper = -inf, inf
    matching = [c for c in conditions if c.quantity is quantity]
    for condition in matching:
        factor = _along(condition.direction, direction)
        if factor != 0.0:
            ends = sorted((condition.lower / factor, condition.upper / factor))
            lower, upper = max(lower, ends[0]), min(upper, ends[1])
    fixed = [c for c in matching if c.lower == c.upper]
    if lower < upper and len(fixed) == 3:
        rows = np.array([c.direction for c in fixed])
        if np.linalg.matrix_rank(rows) == 3:
            lower = upper = float(np.linalg.solve(rows, [c.lower for c in fixed]) @ direction)
    return lower, upper


def _turning_time(problem: Problem, vehicle: Vehicle, sequence: StageSequence) -> float:
    """Return the least time [s] in which the thrust axis passes the stages' attitudes one after another."""
    attitudes = [stage.attitude for stage in sequence.stages if stage.attitude is not None]
    cones = [_Cone(attitude.up, attitude.tolerance) for attitude in attitudes]
    balance = force_balance(problem.environment, vehicle)
    if sequence.closed:
        inner = sum(a.angle(b) for a, b in pairwise(cones[-1:] + cones))
        return inner / vehicle.max_body_rate
    start, goal = (_Cone.of(end, balance) for end in problem.ends.values())
    if not sequence.ordered:
        return max((_turn(vehicle, start, cone) + _turn(vehicle, goal, cone) for cone in cones), default=0.0)
    if not cones:
        return 0.0
    inner = sum(a.angle(b) for a, b in pairwise(cones)) / vehicle.max_body_rate
    return _turn(vehicle, start, cones[0]) + inner + _turn(vehicle, goal, cones[-1])


@dataclass(frozen=True, eq=False)
class _Cone:
    """A cone of thrust directions; at an end of the motion, with the rate at which the thrust turns there."""

    axis: Array  # a unit vector, (3,)
    half_angle: float = 0.0  # [rad]
    rate: float = 0.0  # [rad/s]

    @classmethod
    def of(cls, end: EndState, balance: ForceBalance) -> _Cone:
        """Return the direction at an end; jerk is zero there, so only drag may turn the thrust."""
        thrust = balance.specific_thrust(end.velocity, end.acceleration)
        norm = float(np.linalg.norm(thrust))
        if norm == 0.0 or end.leaves_attitude_free:
            return cls(UP, half_angle=pi)
        rate = balance.drag * float(np.linalg.norm(np.cross(thrust, end.acceleration))) / norm**2
        return cls(thrust / norm, rate=rate)

    def angle(self, other: _Cone) -> float:
        """Return the least angle [rad] between directions in the two cones."""
        apart = float(np.arccos(np.clip(self.axis @ other.axis, -1.0, 1.0)))
        return max(apart - self.half_angle - other.half_angle, 0.0)


def _turn(vehicle: Vehicle, end: _Cone, cone: _Cone) -> float:
    """Return the least time [s] from an end of the motion to an attitude, or back; the rate there is free."""
    angle, acceleration, limit = end.angle(cone), max_angular_acceleration(vehicle), vehicle.max_body_rate
    if acceleration == inf or end.rate >= limit:
        return angle / limit
    spun_up = (limit - end.rate) / acceleration
    if limit < inf and 0.5 * (limit + end.rate) * spun_up <= angle:
        return spun_up + (angle - 0.5 * (limit + end.rate) * spun_up) / limit
    return (sqrt(end.rate**2 + 2.0 * acceleration * angle) - end.rate) / acceleration


def max_angular_acceleration(vehicle: Vehicle) -> float:
    """Return an upper bound [rad/s²] on the angular acceleration about axes across the thrust, without spin.

    The bound is infinite where products of inertia with the thrust axis couple it to the body rate.
    """
    inertia = vehicle.inertia
    if inertia[2, :2].any():
        return inf
    effects = np.linalg.solve(inertia[:2, :2], vehicle.allocation[1:3])  # [rad/s² per N], (2, n)
    limits = np.stack([vehicle.min_thrusts, vehicle.max_thrusts])
    if len(vehicle.rotors) > MANY_ROTORS:
        return float(np.linalg.norm(np.max(limits[:, None] * effects, axis=0).sum(axis=1)))
    vertices = effects @ np.array(list(product(*limits.T))).T
    return float(np.linalg.norm(vertices, axis=0).max())
