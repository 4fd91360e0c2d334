"""The built-in solver: a convex QP for what no choice touches, an exact search over slots for the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf
from time import perf_counter
from typing import ClassVar

import numpy as np

from aerobat.optimization.assignment import AssignmentProgram, AssignmentResult, Mask, Status, certified
from aerobat.optimization.branch_and_bound.candidates import Placements
from aerobat.optimization.branch_and_bound.least_distance import LeastDistance, NotConverged, Point
from aerobat.optimization.branch_and_bound.null_space import Bounds, Reduction, parts
from aerobat.optimization.branch_and_bound.tree import Tree

_MATRICES = ("rows", "equality", "hessian", "gradient")
_EQUAL = 1e-12  # bounds closer than this, relative to the larger, make an equality
_CROSSED = 1e-9  # a lower bound above the upper by more, on the same scale, makes a contradiction


class StageSearch:
    """Solves assignment programs exactly, and keeps factorisations for the next with the same matrices.

    Not for several threads at once: give each its own.
    """

    name: ClassVar[str] = "builtin"
    _kept: _Factorised | None = None

    def solve(
        self,
        program: AssignmentProgram,
        *,
        time_limit: float | None = None,
        start: Sequence[int] | None = None,
    ) -> AssignmentResult:
        """The cheapest assignment, or the best one that `time_limit` [s] leaves time to find.

        `start`, slots that may be good, is tried first: what costs more is then not searched.
        """
        program.check_start(start)
        began = perf_counter()
        deadline = inf if time_limit is None else began + time_limit
        result = certified(program, self._claim(program, deadline, start))
        return replace(result, time=perf_counter() - began)

    def _claim(
        self, program: AssignmentProgram, deadline: float, start: Sequence[int] | None
    ) -> AssignmentResult:
        fixed = {i: stage.slots[0] for i, stage in enumerate(program.stages) if len(stage.slots) == 1}
        lower, upper = program.tightened([fixed.get(i) for i in range(len(program.stages))])
        larger = np.maximum(np.abs(lower), np.abs(upper))
        scale = np.where(np.isfinite(larger), larger, 0.0)
        if (lower - upper > _CROSSED * scale).any() or not _in_order(program, fixed):
            return _nothing("infeasible", inf)
        pinned = upper - lower <= _EQUAL * scale
        if self._kept is None or not self._kept.serves(program, pinned):
            self._kept = _Factorised(program, pinned)
        kept = self._kept
        coupled = kept.coupled.bounds(program, lower, upper)
        apart = kept.apart.bounds(program, lower, upper)
        apart = apart.over(apart.size or 1.0)
        if not (coupled.consistent and apart.consistent):
            return _nothing("infeasible", inf)
        try:
            alone = kept.alone.solve(apart.lower, apart.upper)
        except NotConverged:
            return _nothing("unknown", -inf)
        if alone is None:
            return _nothing("infeasible", inf)
        posed = _Posed(program, kept, fixed, coupled, apart, alone)
        return posed.searched(deadline, start)


class _Factorised:
    """What depends on the matrices, on which rows are equalities and on the rows of the stages."""

    def __init__(self, program: AssignmentProgram, pinned: Mask) -> None:
        self._program, self._pinned = program, pinned
        used = [stage.rows.ravel() for stage in program.stages if len(stage.slots) > 1]
        coupled, apart = parts(program, np.concatenate([np.zeros(0, dtype=np.intp), *used]))
        self.coupled, self.apart = Reduction(program, coupled, pinned), Reduction(program, apart, pinned)
        self.placements = Placements(program, self.coupled)
        self.solver, self.alone = LeastDistance(self.coupled.rows), LeastDistance(self.apart.rows)

    def serves(self, program: AssignmentProgram, pinned: Mask) -> bool:
        """Whether another program has the same matrices, and the same rows in the same roles."""
        kept = self._program
        if kept.precedence != program.precedence or len(kept.stages) != len(program.stages):
            return False
        stages = zip(kept.stages, program.stages, strict=True)
        return (
            all(getattr(kept, name) is getattr(program, name) for name in _MATRICES)
            and np.array_equal(self._pinned, pinned)
            and all(a.slots == b.slots and np.array_equal(a.rows, b.rows) for a, b in stages)
        )


@dataclass(frozen=True, eq=False)
class _Posed:
    """A program ready to be searched."""

    program: AssignmentProgram
    kept: _Factorised
    fixed: dict[int, int]  # stage: its only slot
    coupled: Bounds  # of what the other stages touch
    apart: Bounds  # of the rest,
    alone: Point  # and its solution

    def searched(self, deadline: float, start: Sequence[int] | None) -> AssignmentResult:
        """What a search finds by `deadline`."""
        kept, program = self.kept, self.program
        placed = kept.placements.bounds(program, kept.coupled, self.coupled)
        unit = max(self.coupled.size, kept.placements.size(placed)) or 1.0
        coupled = self.coupled.over(unit)
        tree = Tree(kept.placements, placed.over(unit), kept.solver, coupled)
        if start is not None:
            tree.try_slots({i: slot for i, slot in enumerate(start) if i not in self.fixed})
        tree.search(deadline)
        base = program.constant + self.apart.cost(self.alone.value)
        bound = base + coupled.cost(tree.bound)
        if tree.best is None:
            return replace(_nothing(tree.status, bound), nodes=tree.nodes)
        point, chosen = tree.best
        x = np.zeros(program.variables)
        x[kept.coupled.columns] = kept.coupled.lifted(coupled, point.y)
        x[kept.apart.columns] = kept.apart.lifted(self.apart, self.alone.y)
        slots = self.fixed | {int(kept.placements.stage[p]): int(kept.placements.slot[p]) for p in chosen}
        return AssignmentResult(
            status=tree.status,
            x=x,
            slots=tuple(slots[i] for i in range(len(program.stages))),
            cost=base + coupled.cost(point.value),
            bound=bound,
            nodes=tree.nodes,
            time=0.0,
            backend=StageSearch.name,
        )


def _nothing(status: Status, bound: float) -> AssignmentResult:
    return AssignmentResult(status, None, None, inf, bound, 0, 0.0, StageSearch.name)


def _in_order(program: AssignmentProgram, fixed: dict[int, int]) -> bool:
    """Whether the precedence has no circle and the fixed stages sit in distinct slots, in order."""
    slots = list(fixed.values())
    ordered = all(fixed[i] < fixed[j] for i in fixed for j in fixed if program.before[i, j])
    return ordered and len(set(slots)) == len(slots) and not program.before.diagonal().any()
