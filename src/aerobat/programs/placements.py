"""All ways to place the stages, side by side, and how much each of them must cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf

import numpy as np

from aerobat.arrays import Array
from aerobat.programs.assignment import AssignmentProgram, Indices, Mask
from aerobat.programs.dual_steps import dual_steps
from aerobat.programs.least_distance import Point
from aerobat.programs.reduction import Bounds, Reduction, in_units

_HOLDS = 1e-9  # a placement violated by less, in units of the solution's least size, holds already
_SHORT = 1e-9  # a row whose square off the active rows is below this counts as this long


@dataclass(frozen=True, eq=False)
class PlacedBounds:
    """The bounds that each placement sets, on rows of unit length."""

    lower: Array  # (P, k)
    upper: Array  # (P, k)
    possible: Mask  # (P,) False where a placement contradicts the standing bounds or a fixed stage

    def over(self, unit: float) -> PlacedBounds:
        """The same for y in units of `unit`."""
        return PlacedBounds(in_units(self.lower, unit), in_units(self.upper, unit), self.possible)


@dataclass(frozen=True, eq=False)
class Prospects:
    """What a point says of some placements."""

    among: Indices  # (q,) the placements, sorted by stage
    stage: Indices  # (q,) their stages, counting those with several slots
    least: Array  # (q,) no point that satisfies the placement too has a smaller ½|y|²
    holds: Mask  # (q,) the point itself satisfies it


class Placements:
    """Every slot of every stage that has several: P placements of k rows each, sorted by stage.

    Depends on the matrices and on the stages' rows alone; `bounds` brings the bounds in. A stage of fewer
    rows than another is padded with the reduction's all-zero row.
    """

    def __init__(self, program: AssignmentProgram, reduction: Reduction) -> None:
        """`reduction` has all rows of those stages."""
        self.free = tuple(i for i, stage in enumerate(program.stages) if len(stage.slots) > 1)
        stages = [program.stages[i] for i in self.free]
        self._width = max((stage.rows.shape[1] for stage in stages), default=0)
        counts = [len(stage.slots) for stage in stages]
        self.stage = np.repeat(np.array(self.free, dtype=np.intp), counts)
        self.order = np.repeat(np.arange(len(stages)), counts)  # the place of the stage in `free`
        self.slot = np.array([slot for stage in stages for slot in stage.slots], dtype=np.intp)
        self.starts = np.cumsum([0, *counts])  # stage free[i] has the placements starts[i]..starts[i+1] - 1
        self.compatible = _compatible(program, self.stage, self.slot)

        place = np.full(len(program.rows), reduction.zero)
        place[reduction.ranges] = np.arange(len(reduction.ranges))
        self.rows = self._padded([place[stage.rows] for stage in stages], reduction.zero).astype(np.intp)
        used, use = np.unique(self.rows, return_inverse=True)
        self._use = use.reshape(self.rows.shape)  # where each row is among those used
        self._matrix, self._used = reduction.rows, reduction.rows[used]
        self._gram = reduction.rows @ self._used.T
        self._square = (self._used**2).sum(axis=1)
        self._own = self._used[self._use]  # (P, k, n)
        self._pairs = self._own @ self._own.swapaxes(1, 2)  # (P, k, k)

    def _padded(self, blocks: Sequence[Array | Indices], filler: float) -> Array:
        padded = np.full((len(self.stage), self._width), filler)
        for block, start, end in zip(blocks, self.starts[:-1], self.starts[1:], strict=True):
            padded[start:end, : block.shape[1]] = block
        return padded

    def bounds(self, program: AssignmentProgram, reduction: Reduction, standing: Bounds) -> PlacedBounds:
        """The placements' bounds for the program's stages, within the standing ones."""
        lower = self._padded([stage.lower for stage in program.stages if len(stage.slots) > 1], -inf)
        upper = self._padded([stage.upper for stage in program.stages if len(stage.slots) > 1], inf)
        lower = np.maximum(reduction.scaled(lower, standing.shift, self.rows), standing.lower[self.rows])
        upper = np.minimum(reduction.scaled(upper, standing.shift, self.rows), standing.upper[self.rows])
        constant, slack = reduction.constant[self.rows], standing.slack[self.rows]
        fits = np.where(constant, (lower <= slack) & (upper >= -slack), lower <= upper)
        possible = np.all(fits, axis=1)
        for i, stage in enumerate(program.stages):
            if len(stage.slots) == 1:
                possible &= _beside(program, self.stage, self.slot, i, stage.slots[0])
        return PlacedBounds(np.where(constant, -inf, lower), np.where(constant, inf, upper), possible)

    def size(self, placed: PlacedBounds) -> float:
        """No solution has a shorter y: at y = 0 some stage, wherever it sits, violates a row by this much."""
        missed = np.maximum(placed.lower, -placed.upper).max(axis=1, initial=0.0)
        least = [missed[a:b][placed.possible[a:b]].min(initial=inf) for a, b in pairwise(self.starts)]
        return max((float(size) for size in least if size < inf), default=0.0)

    def prospects(self, point: Point, placed: PlacedBounds, among: Indices) -> Prospects:
        """What adding any one of the placements `among` to the point's bounds costs at least.

        From the point's multipliers a placement's violated rows push, each by its violation over its square
        off the active rows, and the active rows give way. The bound is the dual objective −½|Mᵀλ|² − λᵀb at
        the multipliers so reached: dual feasible, hence a bound whatever the steps were.
        """
        use, pairs, own = self._use[among], self._pairs[among], self._own[among]
        reached = (self._used @ point.y)[use]
        nearest = np.minimum(np.maximum(reached, placed.lower[among]), placed.upper[among])
        violation = reached - nearest  # (q, k), positive above the upper bound
        holds = np.all(np.abs(violation) <= _HOLDS, axis=1)
        active = self._matrix[point.active]
        inverse = np.linalg.inv(active @ active.T)
        cross = self._gram[point.active]  # (w, used)
        rates = inverse @ cross
        square = np.maximum(self._square - (cross * rates).sum(axis=0), _SHORT)
        push = violation / square[use]
        slope = (violation * push).sum(axis=1)
        give = _combined(rates, use, push)  # (w, q)
        straight = ((push[:, None, :] @ pairs)[:, 0] * push).sum(axis=1)
        curvature = np.maximum(straight - (_combined(cross, use, push) * give).sum(axis=0), _SHORT * slope)
        lower, upper = point.lower[point.active], point.upper[point.active]
        multipliers, pushed = dual_steps(inverse, point.multipliers, lower == upper, give, slope, curvature)
        push *= pushed[:, None]
        held = multipliers.T @ active + (push[:, None, :] @ own)[:, 0]  # Mᵀλ, (q, n)
        bound = np.where(point.multipliers > 0.0, upper, lower)
        dual = -0.5 * (held**2).sum(axis=1) - bound @ multipliers - (push * nearest).sum(axis=1)
        return Prospects(among, self.order[among], np.maximum(dual, point.value), holds)


def _combined(columns: Array, use: Indices, weights: Array) -> Array:
    """Σ_k weights[p, k] · columns[:, use[p, k]], (w, P)."""
    total = columns[:, use[:, 0]] * weights[:, 0]
    for k in range(1, use.shape[1]):
        total += columns[:, use[:, k]] * weights[:, k]
    return total


def _compatible(program: AssignmentProgram, stage: Indices, slot: Indices) -> Mask:
    """(P, P) whether two placements may stand together: other stages, other slots, in order."""
    pairs = [_beside(program, stage, slot, i, j) for i, j in zip(stage.tolist(), slot.tolist(), strict=True)]
    return np.array(pairs, dtype=bool).reshape(len(stage), len(stage))


def _beside(program: AssignmentProgram, stage: Indices, slot: Indices, i: int, taken: int) -> Mask:
    """(P,) which placements may stand beside stage i in slot `taken`."""
    before, after = program.before[stage, i], program.before[i, stage]
    ordered = (~before | (slot < taken)) & (~after | (slot > taken))
    result: Mask = ordered & (stage != i) & (slot != taken)
    return result
