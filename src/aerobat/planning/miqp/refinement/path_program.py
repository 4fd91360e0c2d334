"""A path through fixed slots within what its vehicle can do: the shortest, or one of a fixed interval.

Branch and bound knows bounds per axis only. What it finds is refined here with rotors, commands, body rate,
limits and conditions held at places along all intervals; the variables are the inputs, how long the intervals
of each phase are, and the mean interval. Goal and stages are met exactly at every step.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from aerobat.arrays import Array, Indices, Mask
from aerobat.limits.body_in_gate import BodyInGate
from aerobat.limits.path_condition import limit_of
from aerobat.optimization.prox_linear import Linearization
from aerobat.planning.miqp.formulation import Formulation
from aerobat.planning.miqp.refinement.limit_rows import LimitRows, stage_rows
from aerobat.planning.miqp.refinement.phases import DERIVATIVES, PhasedChain, Places, Samples
from aerobat.planning.miqp.refinement.room_rows import RoomRows
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

PARTS = 4  # of each interval, at whose ends constraints are held
NEAR = 0.15  # of a constraint's range: nearer ones are rows of a step
RESERVE_BACKOFF = 2e-4  # of the vehicle's limits' ranges, which the certificate can tell
RESERVE_SLACK = 0.5 * RESERVE_BACKOFF  # of that, by which a path may miss it
EXCESS_FACTOR = 1.2  # backoff for each unit of excess between places
EXCESS_BACKOFF = 1e-4  # and so much more, for what moves while it is made up for
NEGLIGIBLE = 5e-10  # of a constraint's range
STAGE_BACKOFF = 2e-7  # of the range of what a stage asks: QPs miss long rows by a quarter of that
REACH = 0.15  # of the mean interval and of each phase's, in one step
MIN_RATIO = 0.3  # of an interval to the mean
RATIO_SCALE = 0.3  # change of a ratio that counts as much as a whole unit of ln h


@dataclass(frozen=True, eq=False)
class PathProgram:
    """Paths through fixed slots as a smooth program, all constraints as fractions of their ranges."""

    formulation: Formulation
    vehicle: Vehicle
    slots: tuple[int, ...]  # one a stage
    equal: bool  # intervals all of the same length, or phases each of their own
    scale_of_input: float  # a normalised input that counts
    held: bool = False  # times as they are: any path within all constraints will do
    reserve: float = RESERVE_BACKOFF  # of what the vehicle can do, kept everywhere
    backoff: Array = field(default_factory=lambda: np.zeros(0))  # of each interval and constraint, (N, c)
    in_gates: tuple[BodyInGate, ...] = ()  # that the stages cross

    @cached_property
    def chain(self) -> PhasedChain:
        """Its intervals in phases, one phase where all are equal."""
        intervals = self.formulation.chain.intervals
        ends = [intervals] if self.equal else sorted({slot + 1 for slot in self.slots} | {intervals})
        return PhasedChain(self.formulation.initial, tuple(np.diff([0, *ends]).tolist()))

    @property
    def cost(self) -> Array:
        """The logarithm of the mean interval, where the shortest is wanted."""
        cost = np.zeros(self._size)
        cost[-1] = float(not self.held)
        return cost

    @cached_property
    def scale(self) -> Array:
        """How far each variable moves for a change that counts."""
        inputs = 3 * self.chain.intervals
        scale = np.full(self._size, self.scale_of_input * np.sqrt(self.chain.intervals))
        scale[inputs:] = RATIO_SCALE
        scale[-1] = 1.0
        return scale

    @cached_property
    def reach(self) -> Array:
        """The farthest that one step may go."""
        reach = np.full(self._size, np.inf)
        reach[3 * self.chain.intervals :] = 0.0 if self.held else REACH
        return reach

    @cached_property
    def bounded(self) -> tuple[Array, Array, Array]:
        """Ratios that add up, none of them tiny, and stages within their windows of time."""
        counts, intervals = np.array(self.chain.counts, dtype=float), self.chain.intervals
        if self.equal or self.held:
            return np.zeros((0, self._size)), np.zeros(0), np.zeros(0)
        phases = np.eye(len(counts))
        rows, lower, upper = [counts / intervals, *phases], [1.0], [1.0]
        lower += [MIN_RATIO] * len(counts)
        upper += [np.inf] * len(counts)
        for stage, slot in zip(self.formulation.sequence.stages, self.slots, strict=True):
            first, last = stage.window
            if stage.interval_offset:
                first = last = (slot + 1) / intervals
            if (first, last) != (0.0, 1.0):
                rows.append(self.chain.knot_shifts[slot + 1] / intervals)
                lower.append(first)
                upper.append(last)
        matrix = np.zeros((len(rows), self._size))
        matrix[:, 3 * intervals : -1] = rows
        return matrix, np.array(lower), np.array(upper)

    def at(self, x: Array) -> PathPoint | None:
        """The path next to x that meets goal and stages exactly."""
        if not np.isfinite(x).all() or (x[3 * self.chain.intervals : -1] <= 0.0).any():
            return None
        instants = self.chain.samples(x, self._instants)
        rows = instants.input_rows(*self._met[:2])
        size = _sizes(rows)
        residual = _residual(instants, *self._met) / size
        step = np.linalg.lstsq(rows / size[:, None], -residual, rcond=1e-12)[0]
        moved = x.copy()
        moved[: len(step)] += step
        return PathPoint(self, moved)

    def backed_off(self, excess: Array) -> PathProgram:
        """The same with constraints tighter by what is exceeded in each interval, (N, c)."""
        old = self.backoff if self.backoff.size else np.zeros_like(excess)
        return replace(self, backoff=old + EXCESS_FACTOR * excess + EXCESS_BACKOFF * (excess > 0.0))

    @cached_property
    def _size(self) -> int:
        return 3 * self.chain.intervals + len(self.chain.counts) + 1

    @cached_property
    def places(self) -> Places:
        """Where constraints are held."""
        return Places.even(self.chain.intervals, PARTS)

    @cached_property
    def limits(self) -> LimitRows:
        """What holds all along."""
        problem = self.formulation.problem
        return LimitRows(self.formulation.limits, self.vehicle, problem.environment, problem.heading)

    @cached_property
    def room(self) -> RoomRows:
        """The body's room in gates."""
        return RoomRows(self.in_gates, self.vehicle.bounding_ellipsoid, self.formulation.balance)

    @cached_property
    def _instants(self) -> Places:
        """The goal, then the stages."""
        ends = np.array([self.chain.intervals - 1, *self.slots], dtype=np.intp)
        return Places(ends, np.ones(len(ends)))

    @cached_property
    def _stage_rows(self) -> tuple[Indices, Array, Array, Mask]:
        """Conditions of stages as weights · derivatives ≤ bounds, with the places they hold at.

        Places (q,), weights (q, 6, 3), bounds (q,), and which are one side of an equality.
        """
        balance = self.formulation.balance
        found = []
        for i, stage in enumerate(self.formulation.sequence.stages, 1):
            for condition in stage.conditions:
                equal = condition.lower == condition.upper
                rows = list(stage_rows(limit_of(condition, balance)))
                found += [(i, *row, equal) for row in (rows[:1] if equal else rows)]
        return (
            np.array([row[0] for row in found], dtype=np.intp),
            np.array([row[1] for row in found]).reshape(-1, DERIVATIVES, 3),
            np.array([row[2] for row in found]),
            np.array([row[3] for row in found], dtype=bool),
        )

    @cached_property
    def _met(self) -> tuple[Indices, Array, Array]:
        """What is met exactly, goal and equalities of stages: places (p,), weights (p, 6, 3), bounds (p,)."""
        order = self.chain.order
        goal = self.formulation.problem.goal
        met = goal.fixed(order)
        weights = np.zeros((order, 3, DERIVATIVES, 3))
        weights[:, :, :order] = np.eye(3 * order).reshape(order, 3, order, 3)
        weights = weights[met].reshape(-1, DERIVATIVES, 3)
        places, stage_weights, bounds, equal = self._stage_rows
        return (
            np.concatenate([np.zeros(len(weights), dtype=np.intp), places[equal]]),
            np.concatenate([weights, stage_weights[equal]]),
            np.concatenate([goal.derivatives(order)[met].ravel(), bounds[equal]]),
        )


@dataclass(frozen=True, eq=False)
class PathPoint:
    """One path of a program."""

    program: PathProgram
    x: Array

    @cached_property
    def trajectory(self) -> Trajectory:
        """The path, exactly."""
        return self.program.chain.trajectory(self.x, self.program.formulation.problem.heading)

    @cached_property
    def violation(self) -> float:
        """The largest excess, as a fraction of its limit's size, a trifle of what rows aim at aside."""
        kept = self.program.limits.has_reserve
        reserved = self._values[:, kept].max(initial=-1.0) - RESERVE_SLACK
        others = max(self._values[:, ~kept].max(initial=-1.0), self._stage_values.max(initial=-1.0))
        return float(max(reserved, others - NEGLIGIBLE))

    @property
    def excess_sentence(self) -> str:
        """Which limit is exceeded most, by how much and when."""
        place, column = np.unravel_index(int(self._values.argmax()), self._values.shape)
        limit, sign = self.program.limits.sides[column]
        excess, time = float(self._values[place, column]), float(self._samples.times[place])
        return limit.exceeded(excess, time, (limit.fields[sign > 0.0],))

    def linearization(self) -> Linearization:
        """The constraints near the path."""
        program = self.program
        place, column = np.nonzero(self._values > -NEAR)
        weights = program.limits.slopes(self._samples.derivatives, self._frames, place, column)
        values = self._values[place, column]
        at, stage_weights, _, equal = program._stage_rows
        crossing, room = program.room.slopes(self._instants.derivatives[1:])
        rows = [
            self._samples.rows(place, weights),
            self._instants.rows(at[~equal], stage_weights[~equal]),
            self._instants.rows(crossing + 1, room),
        ]
        equality = self._instants.rows(*program._met[:2])
        size = _sizes(equality[:, : 3 * program.chain.intervals])
        return Linearization(
            values=np.concatenate([values, self._stage_values + STAGE_BACKOFF]),
            rows=np.concatenate(rows),
            residual=_residual(self._instants, *program._met) / size,
            equality=equality / size[:, None],
        )

    def excess(self, parts: int) -> Array:
        """By how much constraints, the reserve counted, are exceeded in each interval at places, (N, c)."""
        chain = self.program.chain
        samples = chain.samples(self.x, Places.even(chain.intervals, parts))
        limits = self.program.limits
        values = limits.values(samples.derivatives, limits.frames(samples.times, samples.derivatives))
        values[:, limits.has_reserve] += self.program.reserve - RESERVE_BACKOFF
        worst = values.reshape(chain.intervals, parts + 1, -1).max(axis=1)
        return np.where(worst > NEGLIGIBLE, worst, 0.0)

    def near(self, margin: float) -> Array:
        """1 where constraints are nearer to their bounds than the margin in an interval, else 0, (N, c).

        Zero for limits on the path in the first and the last interval, where start and goal may lie on them.
        """
        values = self._values.reshape(self.program.chain.intervals, PARTS + 1, -1)
        near = np.asarray(values.max(axis=1) > -margin, dtype=float)
        near[np.ix_(np.array([0, len(near) - 1]), np.flatnonzero(self.program.limits.of_path))] = 0.0
        return near

    @cached_property
    def _samples(self) -> Samples:
        return self.program.chain.samples(self.x, self.program.places)

    @cached_property
    def _instants(self) -> Samples:
        return self.program.chain.samples(self.x, self.program._instants)

    @cached_property
    def _frames(self) -> Array:
        return self.program.limits.frames(self._samples.times, self._samples.derivatives)

    @cached_property
    def _values(self) -> Array:
        """The constraints at places, backed off, (m, c)."""
        program = self.program
        values = program.limits.values(self._samples.derivatives, self._frames)
        values[:, program.limits.has_reserve] += program.reserve
        return values + program.backoff[program.places.interval] if program.backoff.size else values

    @cached_property
    def _stage_values(self) -> Array:
        """Inequalities of stages, and the room in the gates that they cross."""
        at, weights, bounds, equal = self.program._stage_rows
        derivatives = self._instants.derivatives
        values = np.sum(weights * derivatives[at], axis=(1, 2)) - bounds
        return np.concatenate([values[~equal], self.program.room.values(derivatives[1:])])


def _sizes(rows: Array) -> Array:
    """Their norms, 1 for rows of zeros."""
    size = np.linalg.norm(rows, axis=1)
    return np.where(size > 0.0, size, 1.0)


def _residual(instants: Samples, places: Indices, weights: Array, bounds: Array) -> Array:
    """By how much Σ weights · derivatives at places exceed bounds, (p,)."""
    return np.asarray(np.sum(weights * instants.derivatives[places], axis=(1, 2)) - bounds)
