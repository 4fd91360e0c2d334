"""Nonlinear program of one refinement round: minimum duration near a path, for the interior point method.

Limits hold at places of every segment, stages at knots. All variables stay in a box (trust region) around the
path. Without the box, large steps lead to motions that satisfy the limits at places and violate them between.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from aerobat.arrays import Array, Indices, Mask
from aerobat.optimization.bordered_band import BorderedBand
from aerobat.planning.refinement.closure import FRACTIONS, Closure
from aerobat.planning.refinement.limit_values import Frames, LimitSlopes, LimitValues
from aerobat.planning.refinement.spline import KnotData, Motion, Spline, basis
from aerobat.planning.refinement.stage_values import MOTION, STATE, StageValues

AT_END = basis(np.array([1.0]))  # the basis at a segment's end, (1, 6, 10)
CLOSURE_PLACES = basis(FRACTIONS)  # (p, 6, 10)
FADED = 0.1  # fraction of the first and last segment over which constraints of the path are scaled up
FADING = 3  # power of the distance from the end in that scaling: positions leave rest no faster
LEAST_FADED = 1e-6  # lower bound that avoids division by zero at the very ends, which are masked out anyway
LIMITED = -1.0  # value that replaces masked constraints: satisfied


@dataclass(frozen=True, eq=False)
class Multipliers:
    """The multipliers of a program's inequalities and the places of its limits, for a warm start."""

    values: Array
    fractions: Array  # (S, p)


@dataclass(frozen=True, eq=False)
class RefinementProgram:
    """Minimize ln h, the logarithm of the mean segment duration, with duration ratios of mean one."""

    spline: Spline
    limits: LimitValues
    stages: StageValues
    stage_segments: tuple[int, ...]  # the segment at whose end each stage holds
    fractions: Array  # places of each segment at which limits hold, ascending, (S, p)
    backoff: Array  # tightening of each constraint in each segment, (S, c)
    radius: float  # half the width of the box of scaled derivatives
    stretch: float  # factor by which durations may change

    @cached_property
    def cost(self) -> Array:
        """The gradient of the cost ln h, (n,)."""
        cost = np.zeros(self.spline.size)
        cost[self.spline.mean_column] = 1.0
        return cost

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the variables, around the path, (n,) each."""
        reach = np.full(self.spline.size, self.radius)
        reach[[*self.spline.ratio_columns, self.spline.mean_column]] = np.log(self.stretch)
        return self.spline.start - reach, self.spline.start + reach

    def at(self, x: Array) -> RefinedPoint:
        """Return the constraints and their derivatives at variables (n,)."""
        return RefinedPoint(self, x)

    def at_its_places(self, multipliers: Multipliers) -> Array:
        """Return multipliers of a program with the same segments and stages, moved to this program's places.

        Each multiplier is divided between the two nearest places of this program, linearly by distance.
        """
        before, places = multipliers.fractions, np.arange(self.fractions.shape[1])
        at_places, others = np.split(multipliers.values, [before.size * self.enforced.shape[-1]])
        pairs = zip(before, self.fractions, strict=True)
        numbers = np.array([np.interp(there, here, places) for there, here in pairs])
        fractions = np.maximum(1.0 - np.abs(numbers[:, None] - places[:, None]), 0.0)
        spread = fractions @ at_places.reshape(*before.shape, -1)
        return np.concatenate([spread.ravel(), others])

    @cached_property
    def places(self) -> Array:
        """The basis at the fractions, (S, p, 6, 10)."""
        return basis(self.fractions)

    @cached_property
    def near(self) -> Frames:
        """The body axes, and planes beside obstacles, along the path around which the program is stated."""
        trajectory = self.spline.trajectory(self.spline.start)
        times = trajectory.knots[:-1, None] + trajectory.durations[:, None] * self.fractions
        derivatives = self.spline.data(self.spline.start).derivatives(self.places).reshape(-1, 6, 3)
        return self.limits.frames(np.minimum(times.ravel(), trajectory.duration), derivatives)

    @cached_property
    def enforced(self) -> Mask:
        """The mask of the constraints that are enforced, (S, p, c).

        Constraints that the fixed ends decide are left out there. Planes count only near obstacles.
        """
        enforced = np.ones((*self.fractions.shape, len(self.limits.sides)), dtype=bool)
        at_start, at_goal = self.limits.at_ends
        enforced[0, 0, at_start] = enforced[-1, -1, at_goal] = False
        planes = self.near.planes
        if planes is not None:
            near = np.isfinite(planes.offsets).reshape(*enforced.shape[:2], -1)
            enforced[..., -near.shape[-1] :] &= near
        return enforced

    @cached_property
    def weights(self) -> Array:
        """Factor on every constraint, (S, p, c): larger close to the ends on limits that these decide.

        So the back-off relative to these limits vanishes at the ends, which may lie on limits of the path.
        """
        weights, held = np.where(self.enforced, 1.0, 0.0), len(self.limits.linear)
        ends = (0, self.fractions[0]), (-1, 1.0 - self.fractions[-1])
        for decided, (segment, inward) in zip(self.limits.at_ends[:, :held], ends, strict=True):
            faded = np.maximum(np.minimum(inward / FADED, 1.0) ** FADING, LEAST_FADED)
            weights[segment, :, np.flatnonzero(decided)] /= faded
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
        """Equalities rows · ratios = targets: the mean ratio is one, some stages have a fixed fraction.

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
        """The constraint that a closed course ends in the attitude of its start; None for open courses."""
        return Closure(self.limits) if self._is_closed else None

    @property
    def _is_closed(self) -> bool:
        return self.spline.task.stages.closed

    @property
    def _windows(self) -> Iterator[tuple[Array, tuple[float, float]]]:
        """Yield each stage's weights on the ratios that give its fraction of the duration, and its window."""
        for stage, segment in zip(self.stages.stages, self.stage_segments, strict=True):
            yield (np.arange(self.spline.segments) <= segment) / self.spline.segments, stage.window


def _stacked(rows: list[tuple[Array, float]], width: int) -> tuple[Array, Array]:
    """Return rows (r, width) and their right-hand sides (r,) as arrays."""
    return np.array([row for row, _ in rows]).reshape(-1, width), np.array([end for _, end in rows])


@dataclass(frozen=True, eq=False)
class RefinedPoint:
    """The constraints of a program at one point, with their first and second derivatives."""

    program: RefinementProgram
    x: Array

    @cached_property
    def inequalities(self) -> Array:
        """The values of the inequalities: limits at places, windows of stages, conditions of stages."""
        program = self.program
        values = program.limits.values(self._derivatives.reshape(-1, 6, 3), program.near)
        values = values.reshape(program.enforced.shape) * program.weights + program.backoff[:, None]
        values[~program.enforced] = LIMITED
        return np.concatenate([values.ravel(), self._others])

    @cached_property
    def equalities(self) -> Array:
        """The values of the equalities: of durations, of stages, and of a closed course's closure."""
        rows, targets = self.program.timed
        found = [rows @ self._data.ratios - targets, self.program.stages.equalities(self._at_stages)]
        if self.program.closure is not None:
            around = self._data.derivatives(CLOSURE_PLACES)
            found.append(self.program.closure.values(around, self._data.durations))
        return np.concatenate(found)

    def missed(self, most: float) -> tuple[Array, Array]:
        """Return what misses stages: values (m,) that should be zero, and their Jacobian (m, n).

        These are the equalities, and the inequalities of stages and windows that are violated. Those of room
        in gates do not count.

        Args:
            most: The largest violation of an inequality that counts.
        """
        values, program = self._others, self.program
        asked = np.arange(len(values)) < len(program.windows[1]) + program.stages.without_rooms
        missed = asked & (values > 0.0) & (values <= most)
        rows = np.concatenate([self.equality_rows, self._other_rows[missed]])
        return np.concatenate([self.equalities, values[missed]]), rows

    @cached_property
    def rows(self) -> RefinedRows:
        """The Jacobian of the inequalities."""
        program = self.program
        limits = program.limits.slopes(self._motion.derivatives.reshape(-1, 6, 3), program.near)
        return RefinedRows(program, self._motion.jacobian, limits, self._other_rows)

    @cached_property
    def equality_rows(self) -> Array:
        """The Jacobian of the equalities, (p, n)."""
        rows, _ = self.program.timed
        timed = np.zeros((len(rows), len(self.x)))
        timed[:, self.program.spline.ratio_columns] = rows * self._data.ratios
        found = [timed, self._stage_rows(*self.program.stages.equality_slopes())]
        if self.program.closure is not None:
            around = self.program.spline.motion(self._data, CLOSURE_PLACES)
            by_motion = self.program.closure.slopes(around.derivatives, self._data.durations)
            by_local = np.einsum("spka,spkaK->sK", by_motion, around.jacobian)
            found.append(self.program.spline.scattered(by_local)[None])
        return np.concatenate(found)

    def curvature(self, inequality_weights: Array, equality_weights: Array, squares: Array) -> BorderedBand:
        """Return the Hessian of the weighted constraints, plus Jᵀ diag(squares) J of inequalities, (n, n)."""
        program, spline = self.program, self.program.spline
        segments, count, kinds = program.enforced.shape
        size, windows = program.enforced.size, len(program.windows[1])
        at_places, others = inequality_weights[:size], inequality_weights[size:]
        faded = program.weights.reshape(-1, kinds)
        weights = at_places.reshape(-1, kinds) * faded
        squared = squares[:size].reshape(-1, kinds) * faded**2
        derivatives = self._motion.derivatives.reshape(-1, 6, 3)
        second = program.limits.curvature(derivatives, program.near, weights, squared)
        moving = self._motion.jacobian.reshape(segments, count, 18, -1)
        bent = (second.reshape(segments, count, 18, 18) @ moving).reshape(segments, count * 18, -1)
        blocks = np.swapaxes(moving.reshape(bent.shape), 1, 2) @ bent
        blocks += self._motion.curvature(self.rows.limits.weighted(weights).reshape(segments, count, 6, 3))
        # only the stages' equalities: the curvature of a closure is neglected
        first, end = len(program.timed[1]), len(equality_weights) - (program.closure is not None)
        blocks += self._stage_blocks(others[windows:], equality_weights[first:end])
        by_ratio = others[:windows] @ program.windows[0] + equality_weights[:first] @ program.timed[0]
        diagonal = np.zeros(spline.size)
        diagonal[spline.ratio_columns] = by_ratio * self._data.ratios
        matrix = spline.assembled(blocks).plus_diagonal(diagonal)
        return matrix.plus_squares(self.rows.others, squares[size:])

    def _stage_blocks(self, inequality_weights: Array, equality_weights: Array) -> Array:
        """Return the Hessian of the stages' weighted constraints, in each segment's local variables."""
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
            jacobian = self._ends.jacobian[segment, 0, :MOTION].reshape(STATE, -1)
            blocks[segment] += jacobian.T @ each @ jacobian
        return blocks

    def _stage_rows(self, at: Indices, weights: Array) -> Array:
        """Return gradients (q, n) of Σ weights · derivatives, with weights (q, 6, 3) at the stages (q,)."""
        spline = self.program.spline
        segments = np.array(self.program.stage_segments, dtype=np.intp)[at]
        jacobian = self._ends.jacobian[segments, 0].reshape(len(at), 18, spline.columns.shape[1])
        rows = np.zeros((len(at), spline.size + 1))
        by_local = (weights.reshape(len(at), 1, 18) @ jacobian)[:, 0]
        rows[np.arange(len(at))[:, None], spline.columns[segments]] = by_local
        return rows[:, :-1]

    @cached_property
    def _others(self) -> Array:
        """The values of the inequalities of windows, then of stages."""
        rows, bounds = self.program.windows
        windows = rows @ self._data.ratios - bounds
        return np.concatenate([windows, self.program.stages.inequalities(self._at_stages)])

    @cached_property
    def _other_rows(self) -> Array:
        """Their Jacobian, (q, n)."""
        windows = np.zeros((len(self.program.windows[1]), len(self.x)))
        windows[:, self.program.spline.ratio_columns] = self.program.windows[0] * self._data.ratios
        return np.concatenate([windows, self._stage_rows(*self._stage_slopes)])

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
        """The stage of each stage inequality, (q,), and its slopes by the derivatives there, (q, 6, 3)."""
        return self.program.stages.inequality_slopes(self._at_stages)

    @cached_property
    def _at_stages(self) -> Array:
        """The derivatives of position at the stages, (stages, 6, 3)."""
        found = self._data.derivatives(AT_END)[:, 0]
        return np.asarray(found[list(self.program.stage_segments)])


@dataclass(frozen=True, eq=False)
class RefinedRows:
    """Jacobian of the inequalities, kept in factors: limits by motion, motion by local variables.

    The other inequalities have dense rows.
    """

    program: RefinementProgram
    motion: Array  # Jacobian of the derivatives by each segment's local variables, (S, p, 6, 3, K + 2)
    limits: LimitSlopes
    others: Array  # dense rows, (q, n)

    def times(self, step: Array) -> Array:
        """Return the product of the Jacobian and a step, (S p c + q,)."""
        change = self._flat @ self.program.spline.gathered(step)[..., None]
        at_places = self.limits.along(change.reshape(-1, 6, 3)).ravel() * self.program.weights.ravel()
        return np.concatenate([at_places, self.others @ step])

    def transposed(self, weights: Array) -> Array:
        """Return the product of the transposed Jacobian and weights, (n,)."""
        enforced = self.program.enforced
        at_places, others = weights[: enforced.size], weights[enforced.size :]
        at_places = at_places * self.program.weights.ravel()
        by_motion = self.limits.weighted(at_places.reshape(-1, enforced.shape[-1]))
        parts = np.swapaxes(self._flat, 1, 2) @ by_motion.reshape(len(enforced), -1, 1)
        return self.program.spline.scattered(parts[..., 0]) + self.others.T @ others

    @property
    def _flat(self) -> Array:
        """The motion's Jacobian as one matrix a segment, (S, 18 p, K + 2)."""
        return self.motion.reshape(len(self.motion), -1, self.motion.shape[-1])
