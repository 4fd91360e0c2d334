"""All ways to place the stages, side by side, and how much each of them must cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization.assignment import AssignmentProgram, Indices, Mask
from aerobat.optimization.branch_and_bound.dual_ascent import Ascent, dual_steps
from aerobat.optimization.branch_and_bound.least_distance import Point
from aerobat.optimization.branch_and_bound.null_space import Bounds, Reduction, in_units

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


@dataclass(frozen=True, eq=False, slots=True)
class Moves:
    """How q placements move a point's multipliers: the w active ones, and those of their own k rows.

    By a share θ of its move the dual objective rises by slope · θ − ½ curvature · θ².
    """

    rows: Array  # (w, n) active
    change: Array  # (w, q) of the active multipliers
    fall: Array  # (w, q) the share of the active multipliers that is given up, zero for equalities
    use: Indices  # (k, q) the placements' rows, among those used
    own: Array  # (k, q) their multipliers
    slope: Array  # (q,)
    curvature: Array  # (q,)
    stopped: frozenset[int]  # of the q, which might raise the objective further
    none: Mask  # (q,) the point satisfies the placement as it is


@dataclass(frozen=True, eq=False, slots=True)
class Prospects:
    """What a point says of some placements."""

    among: Indices  # (q,) the placements, sorted by stage
    stage: Indices  # (q,) their stages, counting those with several slots
    least: Array  # (q,) no point that satisfies the placement too has a smaller ½|y|²
    moves: Moves | None = None  # that tell; None when it is inherited from another point

    def some(self, open_: Mask, limit: float) -> Prospects:
        """Those of the placements in `open_` (P,) that may cost less than `limit`, for points further on."""
        left = open_[self.among] & (self.least < limit)
        return Prospects(self.among[left], self.stage[left], self.least[left])

    def cover(self, stages: Sequence[int]) -> bool:
        """Whether every one of `stages`, which are all there are, has a placement."""
        return len(set(self.stage.tolist())) == len(stages)


class Placements:
    """Every slot of every stage that has several: P placements of k rows each, sorted by stage.

    Depends on the matrices and on the stages' rows alone; `bounds` brings the bounds in. A stage of fewer
    rows than another is padded with the reduction's all-zero row.
    """

    def __init__(self, program: AssignmentProgram, reduction: Reduction) -> None:
        """`reduction` has all rows of those stages."""
        self.free = tuple(i for i, stage in enumerate(program.stages) if len(stage.slots) > 1)
        stages = [program.stages[i] for i in self.free]
        self._widths = np.array([stage.rows.shape[1] for stage in stages], dtype=np.intp)
        self._width = int(self._widths.max(initial=0))
        counts = [len(stage.slots) for stage in stages]
        self.stage = np.repeat(np.array(self.free, dtype=np.intp), counts)
        self.order = np.repeat(np.arange(len(stages)), counts)  # the place of the stage in `free`
        self.slot = np.array([slot for stage in stages for slot in stage.slots], dtype=np.intp)
        self.starts = np.cumsum([0, *counts])  # stage free[i] has the placements starts[i]..starts[i+1] - 1
        self.compatible = _beside(program, self.stage, self.slot, self.stage[:, None], self.slot[:, None])

        place = np.full(len(program.rows), reduction.zero)
        place[reduction.ranges] = np.arange(len(reduction.ranges))
        self.rows = self._padded([place[stage.rows] for stage in stages], reduction.zero).astype(np.intp)
        is_used = np.zeros(len(reduction.rows), dtype=bool)
        is_used[self.rows] = True
        self._use = (is_used.cumsum() - 1)[self.rows]  # where each row is among those used
        self._matrix, self._used = reduction.rows, reduction.rows[is_used]
        self._gram = reduction.rows @ self._used.T
        products = self._gram[is_used]
        self._square = products.diagonal()
        self._pairs = products[self._use[:, None], self._use]  # (k, k, P)

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

    def all(self, placed: PlacedBounds) -> Prospects:
        """All possible placements, of which nothing is known."""
        among = np.flatnonzero(placed.possible)
        return Prospects(among, self.order[among], np.zeros(len(among)))

    def beside(self, placed: Sequence[int], spared: Sequence[int] = ()) -> Mask:
        """The placements that may join those `placed`, without those `spared`, (P,)."""
        open_: Mask = self.compatible[placed[0]]
        for p in placed[1:]:
            open_ = open_ & self.compatible[p]
        if spared:
            open_ = open_.copy()
            open_[list(spared)] = False
        return open_

    def prospects(self, point: Point, placed: PlacedBounds, inherited: Prospects) -> Prospects:
        """What adding any one of the placements inherited to the point's bounds costs at least.

        From the point's multipliers a placement's violated rows push, each by its violation over its square
        off the active rows, and the active rows give way. The bound is the dual objective −½|Mᵀλ|² − λᵀb at
        the multipliers so reached: dual feasible, hence a bound whatever the steps were.
        """
        active = self._active(point)
        asked = self._asked(point, placed, inherited, active)
        give = active.inverse @ asked.against
        slope = np.einsum("kq,kq->q", asked.violation, asked.push)
        curvature = asked.straight - np.einsum("wq,wq->q", asked.against, give)
        ascent = Ascent(give, slope, np.maximum(curvature, _SHORT * slope + _TINY))
        held, pushed, stopped = dual_steps(active.inverse, point.multipliers, active.equal, ascent)
        against = pushed * asked.against + active.bound
        dual = -np.einsum("wq,wq->q", held, 0.5 * (active.gram @ held) + against)
        linear = np.einsum("kq,kq->q", asked.push, asked.nearest)
        dual -= pushed * (linear + (0.5 + _ROUNDING) * pushed * asked.straight)
        least = np.maximum(np.maximum(dual, inherited.least), point.value)
        change, rise = held - point.multipliers[:, None], pushed * slope
        moves = Moves(
            rows=active.rows,
            change=change,
            fall=change / np.where(active.equal, -inf, -point.multipliers)[:, None],
            use=asked.use,
            own=pushed * asked.push,
            slope=rise,
            curvature=2.0 * np.maximum(rise - (dual - point.value), 0.0),
            stopped=frozenset(stopped.tolist()),
            none=np.all(np.abs(asked.violation) <= _HOLDS, axis=0),
        )
        return Prospects(inherited.among, inherited.stage, least, moves)

    def together(self, point: Point, prospects: Prospects, moves: Moves, some: Indices) -> Array:
        """What adding one of `some` (c,) and another of the prospects' q placements costs at least, (c, q).

        Both move the multipliers by the same share θ of what they would alone: the best one that keeps the
        signs of the active multipliers. Infinite where the two cannot stand together.
        """
        moved = moves.change[:, some].T @ moves.rows
        moved += np.einsum("kc,kcn->cn", moves.own[:, some], self._used[moves.use[:, some]])
        crossed = np.einsum("ckq,kq->cq", (moved @ self._used.T).take(moves.use, axis=1), moves.own)
        crossed += (moved @ moves.rows.T) @ moves.change
        slope = moves.slope[some, None] + moves.slope
        apart = moves.curvature[some, None] + moves.curvature
        curvature = apart + 2.0 * crossed
        fallen = (moves.fall[:, some, None] + moves.fall[:, None]).max(axis=0, initial=1.0)
        share = np.minimum(slope / np.maximum(curvature, slope + _TINY), 1.0 / fallen)  # 1 at most
        rise = share * (slope - share * (0.5 * curvature + _ROUNDING * apart))
        alone = np.maximum(prospects.least[some, None], prospects.least)
        bounds: Array = np.maximum(point.value + rise, alone)
        bounds[~self.compatible[prospects.among[some, None], prospects.among]] = inf
        return bounds

    def _asked(self, point: Point, placed: PlacedBounds, inherited: Prospects, active: _Active) -> _Asked:
        among, width = inherited.among, self._widths[inherited.stage].max(initial=0)
        use = self._use[:width].take(among, axis=1)
        lower, upper = (bound[:width].take(among, axis=1) for bound in (placed.lower, placed.upper))
        reached = (self._used @ point.y).take(use)
        nearest = np.minimum(np.maximum(reached, lower), upper)
        violation = reached - nearest
        push = violation / active.square.take(use)
        pairs = self._pairs[:width, :width].take(among, axis=2)
        return _Asked(
            use=use,
            nearest=nearest,
            violation=violation,
            push=push,
            against=np.einsum("wkq,kq->wq", active.cross.take(use, axis=1), push),
            straight=np.einsum("abq,aq,bq->q", pairs, push, push),
        )

    def _active(self, point: Point) -> _Active:
        lower, upper = point.lower[point.active], point.upper[point.active]
        rows = self._matrix[point.active]
        gram = rows @ rows.T
        inverse = np.asarray(np.linalg.inv(gram), dtype=np.float64)
        cross = self._gram[point.active]
        square = self._square - np.einsum("wu,wu->u", cross, inverse @ cross)
        return _Active(
            rows=rows,
            gram=gram,
            inverse=inverse,
            cross=cross,
            square=np.maximum(square, _SHORT),
            bound=np.where(point.multipliers > 0.0, upper, lower)[:, None],
            equal=lower == upper,
        )


@dataclass(frozen=True, eq=False, slots=True)
class _Active:
    """The w rows that hold a point, and how the u rows that placements use see them."""

    rows: Array  # (w, n)
    gram: Array  # (w, w)
    inverse: Array  # of it
    cross: Array  # (w, u) products with the placements' rows
    square: Array  # (u,) of the placements' rows off these
    bound: Array  # (w, 1) that holds
    equal: Mask  # (w,) whether it is an equality


@dataclass(frozen=True, eq=False, slots=True)
class _Asked:
    """What q placements of k rows ask of a point."""

    use: Indices  # (k, q) their rows, among those used
    nearest: Array  # (k, q) to what the point reaches, within their bounds
    violation: Array  # (k, q) of them, positive above the upper bound
    push: Array  # (k, q) of their rows' multipliers
    against: Array  # (w, q) by it, what the active rows see
    straight: Array  # (q,) its square


def _beside(
    program: AssignmentProgram, stage: Indices, slot: Indices, other: Indices | int, taken: Indices | int
) -> Mask:
    """Whether stages may stand in slots while others stand in theirs: others, in other slots, in order."""
    result: Mask = (stage != other) & (slot != taken)
    if program.precedence:
        result &= (slot < taken) | ~program.before[stage, other]
        result &= (slot > taken) | ~program.before[other, stage]
    return result
