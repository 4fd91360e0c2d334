"""All ways to place the stages, side by side, and how much each of them must cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf

import numpy as np

from aerobat.arrays import Array
from aerobat.programs.assignment import AssignmentProgram, Indices, Mask
from aerobat.programs.dual_steps import Ascent, dual_steps
from aerobat.programs.least_distance import Point
from aerobat.programs.reduction import Bounds, Reduction, in_units

_HOLDS = 1e-9  # a placement violated by less, in units of the solution's least size, holds already
_ROUNDING = 1e-13  # of the largest term of a dual objective, whose terms may cancel
_TINY = 1e-300
_SHORT = 1e-9  # a row whose square off the active rows is below this counts as this long


@dataclass(frozen=True, eq=False)
class PlacedBounds:
    """The bounds that each placement sets, on rows of unit length."""

    lower: Array  # (k, P)
    upper: Array  # (k, P)
    possible: Mask  # (P,) False where a placement contradicts rows without freedom or a fixed stage

    def over(self, unit: float) -> PlacedBounds:
        """The same for y in units of `unit`, less what contradicts the standing bounds."""
        lower, upper = in_units(self.lower, unit), in_units(self.upper, unit)
        return PlacedBounds(lower, upper, self.possible & np.all(lower <= upper + _HOLDS, axis=0))


@dataclass(frozen=True, eq=False)
class Prospects:
    """What a point says of some placements."""

    among: Indices  # (q,) the placements, sorted by stage
    stage: Indices  # (q,) their stages, counting those with several slots
    least: Array  # (q,) no point that satisfies the placement too has a smaller ½|y|²
    holds: Mask  # (q,) the point itself satisfies it

    def among_open(self, open_: Mask) -> Prospects:
        """Those of a point further on, whose bounds are tighter: of the placements still open."""
        left = open_[self.among]
        nothing = np.zeros(int(left.sum()), dtype=bool)
        return Prospects(self.among[left], self.stage[left], self.least[left], nothing)


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
        self.compatible = _beside(program, self.stage, self.slot, self.stage[:, None], self.slot[:, None])

        place = np.full(len(program.rows), reduction.zero)
        place[reduction.ranges] = np.arange(len(reduction.ranges))
        self.rows = self._padded([place[stage.rows] for stage in stages], reduction.zero).astype(np.intp)
        used, use = np.unique(self.rows, return_inverse=True)
        self._use = use.reshape(self.rows.shape)  # where each row is among those used
        self._matrix, self._used = reduction.rows, reduction.rows[used]
        self._gram = reduction.rows @ self._used.T
        self._square = (self._used**2).sum(axis=1)
        own = self._used[self._use]  # (k, P, n)
        self._pairs = np.einsum("apn,bpn->abp", own, own)

    def _padded(self, blocks: Sequence[Array | Indices], filler: float) -> Array:
        """The stages' blocks (slots, rows) side by side, (k, P)."""
        padded = np.full((self._width, len(self.stage)), filler)
        for block, (start, end) in zip(blocks, pairwise(self.starts), strict=True):
            padded[: block.shape[1], start:end] = block.T
        return padded

    def bounds(self, program: AssignmentProgram, reduction: Reduction, standing: Bounds) -> PlacedBounds:
        """The placements' bounds for the program's stages, within the standing ones."""
        lower = self._padded([stage.lower for stage in program.stages if len(stage.slots) > 1], -inf)
        upper = self._padded([stage.upper for stage in program.stages if len(stage.slots) > 1], inf)
        lower = np.maximum(reduction.scaled(lower, standing.shift, self.rows), standing.lower[self.rows])
        upper = np.minimum(reduction.scaled(upper, standing.shift, self.rows), standing.upper[self.rows])
        constant, slack = reduction.constant[self.rows], standing.slack[self.rows]
        possible = np.all(~constant | (lower <= slack) & (upper >= -slack), axis=0)
        for i, stage in enumerate(program.stages):
            if len(stage.slots) == 1:
                possible &= _beside(program, self.stage, self.slot, i, stage.slots[0])
        return PlacedBounds(np.where(constant, -inf, lower), np.where(constant, inf, upper), possible)

    def size(self, placed: PlacedBounds) -> float:
        """No solution has a shorter y: at y = 0 some stage, wherever it sits, violates a row by this much."""
        missed = np.maximum(placed.lower, -placed.upper).max(axis=0, initial=0.0)
        least = [missed[a:b][placed.possible[a:b]].min(initial=inf) for a, b in pairwise(self.starts)]
        return max((float(size) for size in least if size < inf), default=0.0)

    def prospects(self, point: Point, placed: PlacedBounds, among: Indices) -> Prospects:
        """What adding any one of the placements `among` to the point's bounds costs at least.

        From the point's multipliers a placement's violated rows push, each by its violation over its square
        off the active rows, and the active rows give way. The bound is the dual objective −½|Mᵀλ|² − λᵀb at
        the multipliers so reached: dual feasible, hence a bound whatever the steps were.
        """
        active, lower, upper = self._active(point, among), placed.lower[:, among], placed.upper[:, among]
        reached = (self._used @ point.y)[self._use[:, among]]
        nearest = np.minimum(np.maximum(reached, lower), upper)
        violation = reached - nearest  # (k, q), positive above the upper bound
        push = violation / active.square
        straight = (self._pairs[:, :, among] * push * push[:, None]).sum(axis=(0, 1))
        give, against = (active.rates * push).sum(axis=1), (active.cross * push).sum(axis=1)  # (w, q)
        slope = (violation * push).sum(axis=0)
        curvature = np.maximum(straight - (against * give).sum(axis=0), _SHORT * slope + _TINY)
        ascent = Ascent(give, slope, curvature)
        held, pushed = dual_steps(active.inverse, point.multipliers, active.equal, ascent)
        dual = -(held * (0.5 * (active.gram @ held) + pushed * against + active.bound)).sum(axis=0)
        dual -= pushed * ((push * nearest).sum(axis=0) + (0.5 + _ROUNDING) * pushed * straight)
        holds = np.all(np.abs(violation) <= _HOLDS, axis=0)
        return Prospects(among, self.order[among], np.maximum(dual, point.value), holds)

    def _active(self, point: Point, among: Indices) -> _Active:
        lower, upper = point.lower[point.active], point.upper[point.active]
        rows = self._matrix[point.active]
        gram = rows @ rows.T
        inverse = np.linalg.inv(gram)
        cross = self._gram[point.active]
        rates = inverse @ cross
        square = np.maximum(self._square - (cross * rates).sum(axis=0), _SHORT)
        use = self._use[:, among]
        return _Active(
            gram=gram,
            inverse=inverse,
            cross=cross[:, use],
            rates=rates[:, use],
            square=square[use],
            bound=np.where(point.multipliers > 0.0, upper, lower)[:, None],
            equal=lower == upper,
        )


@dataclass(frozen=True, eq=False, slots=True)
class _Active:
    """The w rows that hold a point, and how the rows of q placements see them."""

    gram: Array  # (w, w)
    inverse: Array  # of it
    cross: Array  # (w, k, q) products with the placements' rows
    rates: Array  # (w, k, q) by how much their multipliers give way to each
    square: Array  # (k, q) of the placements' rows off these
    bound: Array  # (w, 1) that holds
    equal: Mask  # (w,) whether it is an equality


def _beside(
    program: AssignmentProgram, stage: Indices, slot: Indices, other: Indices | int, taken: Indices | int
) -> Mask:
    """Whether stages may stand in slots while others stand in theirs: others, in other slots, in order."""
    before, after = program.before[stage, other], program.before[other, stage]
    ordered = (~before | (slot < taken)) & (~after | (slot > taken))
    result: Mask = ordered & (stage != other) & (slot != taken)
    return result
