"""Lower bounds on the cost of a node with one or two more candidates, from the node's own multipliers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aerobat.arrays import Array, Indices, Mask
from aerobat.optimization.branch_and_bound.candidates import CandidateBounds, Candidates
from aerobat.optimization.branch_and_bound.dual_ascent import MIN_DIVISOR, DualDirections, dual_ascent
from aerobat.optimization.branch_and_bound.least_distance import QPSolution

_CANCELLATION = 1e-13  # rounding error of a dual objective, relative to its largest term
_MIN_SQUARE = 1e-9  # smallest value of a unit row's squared norm after projection off the active rows


@dataclass(frozen=True, eq=False, slots=True)
class DualSteps:
    """Changes of the multipliers by dual ascent: of the w active rows, and of the k rows of q candidates.

    A fraction θ of the step raises the dual objective by slope · θ − ½ curvature · θ².
    """

    active_rows: Array  # (w, n)
    multiplier_change: Array  # (w, q) of the active rows
    fraction_lost: Array  # (w, q) of the active multipliers, zero for equalities
    row_index: Indices  # (k, q) the candidates' rows, as indices into the rows that candidates use
    own_multipliers: Array  # (k, q) of these rows
    slope: Array  # (q,)
    curvature: Array  # (q,)
    blocked: frozenset[int]  # those of the q candidates whose bounds further steps might raise


@dataclass(frozen=True, eq=False, slots=True)
class LowerBounds:
    """Lower bounds on the cost of a node with one more candidate, for q candidates sorted by group."""

    candidates: Indices  # (q,)
    group: Indices  # (q,)
    value: Array  # (q,) lower bound of ½|y|² over all y of the node that also satisfy the candidate

    def restricted(self, allowed: Mask, cutoff: float) -> LowerBounds:
        """Return the bounds of `allowed` (P,) candidates that are below `cutoff`, for descendant nodes."""
        keep = allowed[self.candidates] & (self.value < cutoff)
        return LowerBounds(self.candidates[keep], self.group[keep], self.value[keep])

    def covers_all_stages(self, groups: Sequence[int]) -> bool:
        """Tell if each of `groups` has a candidate. No other groups occur."""
        return len(set(self.group.tolist())) == len(groups)


class DualBounds:
    """Lower bounds by dual ascent. They depend only on the matrices and on the rows of the stages."""

    def __init__(self, candidates: Candidates, rows: Array) -> None:
        """`rows` are the rows M of the null space."""
        self._candidates = candidates
        self._rows = rows
        is_used = np.zeros(len(rows), dtype=bool)
        is_used[candidates.rows] = True
        self._row_index = (is_used.cumsum() - 1)[candidates.rows]  # (k, P)
        self._used_rows = rows[is_used]  # (u, n)
        self._cross_gram = rows @ self._used_rows.T  # (m + 1, u)
        gram = self._cross_gram[is_used]
        self._squares = gram.diagonal()
        self._candidate_grams = gram[self._row_index[:, None], self._row_index]  # (k, k, P)

    def root_bounds(self, bounds: CandidateBounds) -> LowerBounds:
        """Return bounds of zero for all possible candidates."""
        possible = np.flatnonzero(bounds.possible)
        return LowerBounds(possible, self._candidates.group[possible], np.zeros(len(possible)))

    def single_bounds(
        self, solution: QPSolution, bounds: CandidateBounds, inherited: LowerBounds
    ) -> tuple[LowerBounds, DualSteps]:
        """Return the lower bounds for the node of `solution` with any one of the inherited candidates added.

        The multiplier of each violated row of a candidate rises by the violation, divided by the squared norm
        of the row off the active rows. The multipliers of the active rows follow. The bound is the dual
        objective −½|Mᵀλ|² − λᵀb at the resulting multipliers. They are dual feasible, so the bound is valid
        for any steps.
        """
        active_rows = self._rows[solution.active]  # (w, n)
        active_lower, active_upper = solution.lower[solution.active], solution.upper[solution.active]
        is_equality = active_lower == active_upper
        gram = active_rows @ active_rows.T
        inverse_gram = np.asarray(np.linalg.inv(gram), dtype=np.float64)
        cross_gram = self._cross_gram[solution.active]  # (w, u)
        squares = self._squares - np.einsum("wu,wu->u", cross_gram, inverse_gram @ cross_gram)

        candidates = inherited.candidates
        width = self._candidates.widths[inherited.group].max(initial=0)
        row_index = self._row_index[:width].take(candidates, axis=1)  # (k, q)
        lower = bounds.lower[:width].take(candidates, axis=1)
        upper = bounds.upper[:width].take(candidates, axis=1)
        values = (self._used_rows @ solution.y).take(row_index)
        nearest = np.minimum(np.maximum(values, lower), upper)
        violation = values - nearest
        direction = violation / np.maximum(squares, _MIN_SQUARE).take(row_index)
        coupling = np.einsum("wkq,kq->wq", cross_gram.take(row_index, axis=1), direction)
        grams = self._candidate_grams[:width, :width].take(candidates, axis=2)
        square = np.einsum("abq,aq,bq->q", grams, direction, direction)

        rate = inverse_gram @ coupling
        slope = np.einsum("kq,kq->q", violation, direction)
        curvature = square - np.einsum("wq,wq->q", coupling, rate)
        curvature = np.maximum(curvature, _MIN_SQUARE * slope + MIN_DIVISOR)
        multipliers, step, blocked = dual_ascent(
            inverse_gram, solution.multipliers, is_equality, DualDirections(rate, slope, curvature)
        )

        active_bound = np.where(solution.multipliers > 0.0, active_upper, active_lower)[:, None]
        linear = step * coupling + active_bound
        dual = -np.einsum("wq,wq->q", multipliers, 0.5 * (gram @ multipliers) + linear)
        own_linear = np.einsum("kq,kq->q", direction, nearest)
        dual -= step * (own_linear + (0.5 + _CANCELLATION) * step * square)
        value = np.maximum(np.maximum(dual, inherited.value), solution.value)
        change = multipliers - solution.multipliers[:, None]
        rise = step * slope
        steps = DualSteps(
            active_rows=active_rows,
            multiplier_change=change,
            fraction_lost=change / np.where(is_equality, -np.inf, -solution.multipliers)[:, None],
            row_index=row_index,
            own_multipliers=step * direction,
            slope=rise,
            curvature=2.0 * np.maximum(rise - (dual - solution.value), 0.0),
            blocked=frozenset(blocked.tolist()),
        )
        return LowerBounds(candidates, inherited.group, value), steps

    def pairwise_bounds(
        self, solution: QPSolution, lower_bounds: LowerBounds, steps: DualSteps, some: Indices
    ) -> Array:
        """Return the lower bounds for one of `some` and any of the q candidates added together, (c, q).

        Both candidates' steps are scaled by one fraction θ: the best one that keeps the signs of the active
        multipliers. The bound is infinite where the two are not compatible.

        Args:
            solution: the solution of the node.
            lower_bounds: the bounds of the node for q candidates.
            steps: the dual steps that prove these bounds.
            some: indices of c of the q candidates, (c,).
        """
        moved = steps.multiplier_change[:, some].T @ steps.active_rows
        moved += np.einsum(
            "kc,kcn->cn", steps.own_multipliers[:, some], self._used_rows[steps.row_index[:, some]]
        )
        products = (moved @ self._used_rows.T).take(steps.row_index, axis=1)
        cross = np.einsum("ckq,kq->cq", products, steps.own_multipliers)
        cross += (moved @ steps.active_rows.T) @ steps.multiplier_change
        slope = steps.slope[some, None] + steps.slope
        separate = steps.curvature[some, None] + steps.curvature
        curvature = separate + 2.0 * cross
        lost = (steps.fraction_lost[:, some, None] + steps.fraction_lost[:, None]).max(axis=0, initial=1.0)
        fraction = np.minimum(slope / np.maximum(curvature, slope + MIN_DIVISOR), 1.0 / lost)  # at most 1
        rise = fraction * (slope - fraction * (0.5 * curvature + _CANCELLATION * separate))
        alone = np.maximum(lower_bounds.value[some, None], lower_bounds.value)
        bounds: Array = np.maximum(solution.value + rise, alone)
        candidates = lower_bounds.candidates
        bounds[~self._candidates.compatible[candidates[some, None], candidates]] = np.inf
        return bounds
