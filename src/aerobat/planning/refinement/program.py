"""The fastest polynomials near a path within all limits, as a program for the interior point method.

Limits hold at places of every segment, stages at knots. All variables stay in a box around the path: limits
hold at places only, and what is free to leap finds motions that cheat between them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from aerobat.arrays import Array, Indices, Mask
from aerobat.planning.refinement.closure import FRACTIONS, Closure
from aerobat.planning.refinement.limit_values import Frames, LimitSlopes, LimitValues
from aerobat.planning.refinement.spline import KnotData, Motion, Spline, basis
from aerobat.planning.refinement.stage_values import KNOWN, STATE, StageValues

AT_END = basis(np.array([1.0]))  # of a segment, (1, 6, 10)
CLOSURE_PLACES = basis(FRACTIONS)  # (p, 6, 10)
FADED = 0.1  # of the first and the last segment, along which constraints of the path grow from nothing,
FADING = 3  # with this power of the way inward: positions leave rest no faster
LEAST_FADED = 1e-6  # so that the very ends, which do not count, divide by no zero
LIMITED = -1.0  # the value of a constraint that does not count


@dataclass(frozen=True, eq=False)
class Multipliers:
    """The multipliers of a program's inequalities, and the places of its limits."""

    values: Array
    fractions: Array  # (S, p)


@dataclass(frozen=True, eq=False)
class RefinementProgram:
    """Minimize ln h, the ratios of durations adding up to their number."""

    spline: Spline
    limits: LimitValues
    stages: StageValues
    stage_segments: tuple[int, ...]  # at whose ends stages hold
    fractions: Array  # of each segment, at which limits hold, rising, (S, p)
    backoff: Array  # of each segment and constraint, (S, c)
    radius: float  # of the box, of scaled derivatives
    stretch: float  # the factor by which durations may differ

    @cached_property
    def cost(self) -> Array:
        """ln h."""
        cost = np.zeros(self.spline.size)
        cost[self.spline.mean_column] = 1.0
        return cost

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Around the path."""
        reach = np.full(self.spline.size, self.radius)
        reach[[*self.spline.ratio_columns, self.spline.mean_column]] = np.log(self.stretch)
        return self.spline.start - reach, self.spline.start + reach

    def at(self, x: Array) -> RefinedPoint:
        """The constraints at a point."""
        return RefinedPoint(self, x)

    def at_its_places(self, multipliers: Multipliers) -> Array:
        """Multipliers of a program with the same segments and stages, at the places of this one.

        The two places here beside each of its places share its multipliers.
        """
        before, places = multipliers.fractions, np.arange(self.fractions.shape[1])
        at_places, others = np.split(multipliers.values, [before.size * self.counts.shape[-1]])
        pairs = zip(before, self.fractions, strict=True)
        numbers = np.array([np.interp(there, here, places) for there, here in pairs])
        shares = np.maximum(1.0 - np.abs(numbers[:, None] - places[:, None]), 0.0)
        spread = shares @ at_places.reshape(*before.shape, -1)
        return np.concatenate([spread.ravel(), others])

    @cached_property
    def places(self) -> Array:
        """The basis at fractions, (S, p, 6, 10)."""
        return basis(self.fractions)

    @cached_property
    def near(self) -> Frames:
        """Body axes along the path that it begins with."""
        trajectory = self.spline.trajectory(self.spline.start)
        times = trajectory.knots[:-1, None] + trajectory.durations[:, None] * self.fractions
        derivatives = self.spline.data(self.spline.start).derivatives(self.places).reshape(-1, 6, 3)
        return self.limits.frames(np.minimum(times.ravel(), trajectory.duration), derivatives)

    @cached_property
    def counts(self) -> Mask:
        """The mask of the constraints that count, (S, p, c).

        Constraints of the path do not count at ends, which are fixed, and planes only where there are
        obstacles near.
        """
        counts = np.ones((*self.fractions.shape, len(self.limits.sides)), dtype=bool)
        counts[0, 0, self.limits.at_ends] = counts[-1, -1, self.limits.at_ends] = self._is_closed
        planes = self.near.planes
        if planes is not None:
            near = np.isfinite(planes.offsets).reshape(*counts.shape[:2], -1)
            counts[..., -near.shape[-1] :] &= near
        return counts

    @cached_property
    def weights(self) -> Array:
        """Of every constraint (S, p, c): those of the path weigh more toward the ends, where nothing moves.

        What is kept there from limits fades instead, as ends may lie on limits of the path.
        """
        weights = np.where(self.counts, 1.0, 0.0)
        ends = () if self._is_closed else ((0, self.fractions[0]), (-1, 1.0 - self.fractions[-1]))
        for segment, inward in ends:
            faded = np.maximum(np.minimum(inward / FADED, 1.0) ** FADING, LEAST_FADED)
            weights[segment, :, self.limits.of_path] /= faded
        return weights

    @cached_property
    def windows(self) -> tuple[Array, Array]:
        """Windows of stages as rows · ratios ≤ bounds, (w, S) and (w,)."""
        rows = [
            (sign * before, sign * end)
            for before, (first, last) in self._windows
            for sign, end, open_end in ((-1.0, first, 0.0), (1.0, last, 1.0))
            if first < last and end != open_end
        ]
        return _stacked(rows, self.spline.segments)

    @cached_property
    def timed(self) -> tuple[Array, Array]:
        """Ratios that add up, and stages at given fractions of the duration, as rows · ratios = targets.

        The seam of a closed course lies half-way in time between the last stage and the first.
        """
        whole = np.full(self.spline.segments, 1.0 / self.spline.segments)
        rows = [(whole, 1.0), *((before, first) for before, (first, last) in self._windows if first == last)]
        if self._is_closed:
            (to_first, _), *_, (to_last, _) = self._windows
            rows.append((to_first + to_last, 1.0))
        return _stacked(rows, self.spline.segments)

    @cached_property
    def closure(self) -> Closure | None:
        """The constraint that a closed course ends in the attitude in which it begins; None of others."""
        return Closure(self.limits) if self._is_closed else None

    @property
    def _is_closed(self) -> bool:
        return self.spline.task.stages.closed

    @property
    def _windows(self) -> Iterator[tuple[Array, tuple[float, float]]]:
        """Of each stage the weights of ratios in the fraction that goes before it, and its window."""
        for stage, segment in zip(self.stages.stages, self.stage_segments, strict=True):
            yield (np.arange(self.spline.segments) <= segment) / self.spline.segments, stage.window


def _stacked(rows: list[tuple[Array, float]], width: int) -> tuple[Array, Array]:
    """Rows (r, width) and what they are held to, (r,)."""
    return np.array([row for row, _ in rows]).reshape(-1, width), np.array([end for _, end in rows])


@dataclass(frozen=True, eq=False)
class RefinedPoint:
    """One path of a program."""

    program: RefinementProgram
    x: Array

    @cached_property
    def inequalities(self) -> Array:
        """Limits at places, windows of stages, and what stages ask."""
        program = self.program
        values = program.limits.values(self._derivatives.reshape(-1, 6, 3), program.near)
        values = values.reshape(program.counts.shape) * program.weights + program.backoff[:, None]
        values[~program.counts] = LIMITED
        rows, bounds = program.windows
        windows = rows @ self._data.ratios - bounds
        return np.concatenate([values.ravel(), windows, program.stages.inequalities(self._at_stages)])

    @cached_property
    def equalities(self) -> Array:
        """The values of the equality constraints on durations, then of those at stages, and of a closure."""
        rows, targets = self.program.timed
        found = [rows @ self._data.ratios - targets, self.program.stages.equalities(self._at_stages)]
        if self.program.closure is not None:
            around = self._data.derivatives(CLOSURE_PLACES)
            found.append(self.program.closure.values(around, self._data.durations))
        return np.concatenate(found)

    @cached_property
    def rows(self) -> RefinedRows:
        """The slopes of the inequalities."""
        program = self.program
        limits = program.limits.slopes(self._motion.derivatives.reshape(-1, 6, 3), program.near)
        windows = np.zeros((len(program.windows[1]), len(self.x)))
        windows[:, program.spline.ratio_columns] = program.windows[0] * self._data.ratios
        others = np.concatenate([windows, self._stage_rows(*self._stage_slopes)])
        return RefinedRows(program, self._motion.slopes, limits, others)

    @cached_property
    def equality_rows(self) -> Array:
        """The slopes of the equalities, (p, n)."""
        rows, _ = self.program.timed
        timed = np.zeros((len(rows), len(self.x)))
        timed[:, self.program.spline.ratio_columns] = rows * self._data.ratios
        found = [timed, self._stage_rows(*self.program.stages.equality_slopes())]
        if self.program.closure is not None:
            around = self.program.spline.motion(self._data, CLOSURE_PLACES)
            by_motion = self.program.closure.slopes(around.derivatives, self._data.durations)
            by_local = np.einsum("spka,spkaK->sK", by_motion, around.slopes)
            found.append(self.program.spline.scattered(by_local)[None])
        return np.concatenate(found)

    def curvature(self, inequality_weights: Array, equality_weights: Array, squares: Array) -> Array:
        """The second derivatives of their weighted sum, and of squares of what moves inequalities, (n, n)."""
        program, spline = self.program, self.program.spline
        segments, count, kinds = program.counts.shape
        size, windows = program.counts.size, len(program.windows[1])
        at_places, others = inequality_weights[:size], inequality_weights[size:]
        faded = program.weights.reshape(-1, kinds)
        weights = at_places.reshape(-1, kinds) * faded
        squared = squares[:size].reshape(-1, kinds) * faded**2
        derivatives = self._motion.derivatives.reshape(-1, 6, 3)
        second = program.limits.curvature(derivatives, program.near, weights, squared)
        moving = self._motion.slopes.reshape(segments, count, 18, -1)
        bent = (second.reshape(segments, count, 18, 18) @ moving).reshape(segments, count * 18, -1)
        blocks = np.swapaxes(moving.reshape(bent.shape), 1, 2) @ bent
        blocks += self._motion.curvature(self.rows.limits.weighted(weights).reshape(segments, count, 6, 3))
        # of the equalities those at stages: a closure's curvature is left out
        first, end = len(program.timed[1]), len(equality_weights) - (program.closure is not None)
        blocks += self._stage_blocks(others[windows:], equality_weights[first:end])
        rows = self.rows.others
        matrix = spline.assembled(blocks) + rows.T @ (squares[size:, None] * rows)
        by_ratio = others[:windows] @ program.windows[0] + equality_weights[:first] @ program.timed[0]
        columns = spline.ratio_columns
        matrix[columns, columns] += by_ratio * self._data.ratios
        return matrix

    def _stage_blocks(self, inequality_weights: Array, equality_weights: Array) -> Array:
        """Second derivatives of what stages ask, by each segment's variables."""
        stages = self.program.stages
        weights = np.zeros((self.program.spline.segments, 1, 6, 3))
        at, by_state = self._stage_slopes
        equal, by_equal = stages.equality_slopes()
        segments = np.array(self.program.stage_segments, dtype=np.intp)
        np.add.at(weights[:, 0], segments[at], inequality_weights[:, None, None] * by_state)
        np.add.at(weights[:, 0], segments[equal], equality_weights[:, None, None] * by_equal)
        blocks = self._ends.curvature(weights)
        second = stages.second_derivatives(self._at_stages, inequality_weights)
        for segment, each in zip(segments, second, strict=True):
            slopes = self._ends.slopes[segment, 0, :KNOWN].reshape(STATE, -1)
            blocks[segment] += slopes.T @ each @ slopes
        return blocks

    def _stage_rows(self, at: Indices, weights: Array) -> Array:
        """Rows (q, n) of Σ weights · derivatives at stages (q,), (q, 6, 3)."""
        spline = self.program.spline
        segments = np.array(self.program.stage_segments, dtype=np.intp)[at]
        slopes = self._ends.slopes[segments, 0].reshape(len(at), 18, spline.columns.shape[1])
        rows = np.zeros((len(at), spline.size + 1))
        by_local = (weights.reshape(len(at), 1, 18) @ slopes)[:, 0]
        rows[np.arange(len(at))[:, None], spline.columns[segments]] = by_local
        return rows[:, :-1]

    @cached_property
    def _data(self) -> KnotData:
        return self.program.spline.data(self.x)

    @cached_property
    def _derivatives(self) -> Array:
        return self._data.derivatives(self.program.places)

    @cached_property
    def _motion(self) -> Motion:
        return self.program.spline.motion(self._data, self.program.places)

    @cached_property
    def _ends(self) -> Motion:
        return self.program.spline.motion(self._data, AT_END)

    @cached_property
    def _stage_slopes(self) -> tuple[Indices, Array]:
        """The stages of what they ask, (q,), and its slopes by the derivatives there, (q, 6, 3)."""
        return self.program.stages.inequality_slopes(self._at_stages)

    @cached_property
    def _at_stages(self) -> Array:
        """Derivatives at stages, (stages, 6, 3)."""
        found = self._data.derivatives(AT_END)[:, 0]
        return np.asarray(found[list(self.program.stage_segments)])


@dataclass(frozen=True, eq=False)
class RefinedRows:
    """Slopes of inequalities: of limits at places by way of the motion there, of others by all variables."""

    program: RefinementProgram
    motion: Array  # by each segment's own variables, (S, p, 6, 3, K + 2)
    limits: LimitSlopes
    others: Array  # (q, n)

    def times(self, step: Array) -> Array:
        """The rows times a step, (S p c + q,)."""
        change = self._flat @ self.program.spline.gathered(step)[..., None]
        at_places = self.limits.along(change.reshape(-1, 6, 3)).ravel() * self.program.weights.ravel()
        return np.concatenate([at_places, self.others @ step])

    def transposed(self, weights: Array) -> Array:
        """The sum of weighted rows, (n,)."""
        counts = self.program.counts
        at_places, others = weights[: counts.size], weights[counts.size :]
        at_places = at_places * self.program.weights.ravel()
        by_motion = self.limits.weighted(at_places.reshape(-1, counts.shape[-1]))
        parts = np.swapaxes(self._flat, 1, 2) @ by_motion.reshape(len(counts), -1, 1)
        return self.program.spline.scattered(parts[..., 0]) + self.others.T @ others

    @property
    def _flat(self) -> Array:
        """The motion's slopes, (S, 18 p, K + 2)."""
        return self.motion.reshape(len(self.motion), -1, self.motion.shape[-1])
