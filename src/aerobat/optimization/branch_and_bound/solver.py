"""The built-in solver: a QP for the part without choices, exact search over slots for the rest, verified."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf
from time import perf_counter
from typing import ClassVar

import numpy as np

from aerobat.arrays import Array, Mask
from aerobat.optimization.assignment import AssignmentProgram
from aerobat.optimization.branch_and_bound.candidates import CandidateBounds, Candidates
from aerobat.optimization.branch_and_bound.least_distance import LeastDistanceQP, NotConverged
from aerobat.optimization.branch_and_bound.lower_bounds import DualBounds
from aerobat.optimization.branch_and_bound.null_space import NullSpace, ReducedBounds, split_coupled
from aerobat.optimization.branch_and_bound.search import BestFirstSearch
from aerobat.optimization.deadline import count_work
from aerobat.optimization.result import AssignmentResult, Status, verified

_MATRICES = ("rows", "equality")
_EQUALITY_TOLERANCE = 1e-12  # bounds closer than this fraction of the larger one make an equality
# a lower bound contradicts the upper one where it exceeds it by this fraction of the larger one
_CONTRADICTION_TOLERANCE = 1e-9
_WORK = 0.4e-3  # work of a program but for its QPs [s], measured (benchmarks/work.py)


class BranchAndBound:
    """An exact solver of assignment programs; it reuses factorizations while the matrices stay the same.

    The solver is not thread-safe: use one for each thread. DERIVATION.md in this folder derives the method
    and proves it.
    """

    name: ClassVar[str] = "builtin"
    package: ClassVar[str] = "daqp"
    extra: ClassVar[str | None] = None

    _factorization: _Factorization | None = None

    def solve(
        self, program: AssignmentProgram, *, node_limit: int | None = None, start: Sequence[int] | None = None
    ) -> AssignmentResult:
        """Solve as `Solver.solve` does. The result's time is the time of the whole call."""
        program.check_start(start)
        began = perf_counter()
        count_work(_WORK)
        claimed = self._claim(program, inf if node_limit is None else node_limit, start)
        return replace(verified(program, claimed), time=perf_counter() - began)

    def _claim(
        self, program: AssignmentProgram, node_limit: float, start: Sequence[int] | None
    ) -> AssignmentResult:
        """Return the assignment of minimum cost, or the best one within the limits, not yet verified."""
        try:
            prepared = self._prepared(program)
        except NotConverged:
            return _without_solution("unknown", -inf)
        if prepared is None:
            return _without_solution("infeasible", inf)
        factorization, blocks = prepared
        return factorization.claim(program, blocks, node_limit, start)

    def _prepared(self, program: AssignmentProgram) -> tuple[_Factorization, _Blocks] | None:
        """Return the factorization (the last one where it still fits) and the two blocks of the program.

        Return None where there is no solution. NotConverged is raised for the independent block's QP; the
        search handles its own failures.
        """
        lower, upper = program.root_bounds
        larger = np.maximum(np.abs(lower), np.abs(upper))
        scale = np.where(np.isfinite(larger), larger, 0.0)
        if (lower - upper > _CONTRADICTION_TOLERANCE * scale).any() or not _is_ordered(program):
            return None
        implicit_equalities = upper - lower <= _EQUALITY_TOLERANCE * scale
        kept = self._factorization
        if kept is None or not kept.fits(program, implicit_equalities):
            kept = _Factorization(program, implicit_equalities)
            self._factorization = kept
        blocks = kept.blocks(program, lower, upper)
        return None if blocks is None else (kept, blocks)


@dataclass(frozen=True, eq=False)
class _Blocks:
    """One program in the null space: the block to be searched, and the independent block, solved."""

    root: ReducedBounds
    bounds: CandidateBounds
    independent: ReducedBounds
    y: Array  # the independent block's solution
    elsewhere: float  # the cost of everything but the searched block


class _Factorization:
    """Everything that depends only on the matrices, the implicit equalities and the rows of the stages."""

    def __init__(self, program: AssignmentProgram, implicit_equalities: Mask) -> None:
        self._program = program
        self._implicit_equalities = implicit_equalities
        stage_rows = [stage.rows.ravel() for stage in program.stages if len(stage.slots) > 1]
        coupled, independent = split_coupled(
            program, np.concatenate([np.zeros(0, dtype=np.intp), *stage_rows])
        )
        self.coupled = NullSpace(program, coupled, implicit_equalities)
        self.independent = NullSpace(program, independent, implicit_equalities)
        self.candidates = Candidates(program, self.coupled)
        self.dual_bounds = DualBounds(self.candidates, self.coupled.rows)
        self.coupled_qp = LeastDistanceQP(self.coupled.rows)
        self.independent_qp = LeastDistanceQP(self.independent.rows)

    def fits(self, program: AssignmentProgram, implicit_equalities: Mask) -> bool:
        """Tell if another program has the same matrices and the same rows in the same roles."""
        own = self._program
        if own.precedence != program.precedence or len(own.stages) != len(program.stages):
            return False
        stages = zip(own.stages, program.stages, strict=True)
        return (
            all(getattr(own, name) is getattr(program, name) for name in _MATRICES)
            and np.array_equal(self._implicit_equalities, implicit_equalities)
            and all(a.slots == b.slots and np.array_equal(a.rows, b.rows) for a, b in stages)
        )

    def claim(
        self,
        program: AssignmentProgram,
        blocks: _Blocks,
        node_limit: float,
        start: Sequence[int] | None,
    ) -> AssignmentResult:
        """Search the coupled block, and combine its solution with that of the independent block."""
        search = BestFirstSearch(
            self.candidates, self.dual_bounds, self.coupled_qp, blocks.bounds, blocks.root
        )
        if start is not None:
            search.try_start({stage: start[stage] for stage in self.candidates.free_stages})
        search.run(node_limit)
        x = slots = None
        if search.best is not None:
            solution, chosen = search.best
            x = np.zeros(program.num_variables)
            x[self.coupled.columns] = self.coupled.expand(blocks.root, solution.y)
            x[self.independent.columns] = self.independent.expand(blocks.independent, blocks.y)
            slots = self.candidates.slots_with(program, chosen)
        return AssignmentResult(
            status=search.status,
            backend=BranchAndBound.name,
            bound=blocks.elsewhere + blocks.root.cost(search.bound),
            x=x,
            slots=slots,
            nodes=search.nodes,
        )

    def blocks(self, program: AssignmentProgram, lower: Array, upper: Array) -> _Blocks | None:
        """Return a program's right-hand sides, with the independent block solved; None if infeasible.

        `lower` and `upper` (m,) are the root's bounds. NotConverged is raised for the independent block's QP.
        """
        root = self.coupled.bounds(program, lower, upper)
        independent = self.independent.bounds(program, lower, upper)
        if not (root.consistent and independent.consistent):
            return None
        independent = independent.in_units(independent.min_norm or 1.0)
        solution = self.independent_qp.solve(independent.lower, independent.upper)
        if solution is None:
            return None
        bounds = self.candidates.bounds(program, self.coupled, root)
        root = root.in_units(max(root.min_norm, self.candidates.min_norm(bounds)) or 1.0)
        elsewhere = independent.cost(solution.value)
        return _Blocks(root, bounds.in_units(root.unit), independent, solution.y, elsewhere)


def _without_solution(status: Status, bound: float) -> AssignmentResult:
    return AssignmentResult(status=status, backend=BranchAndBound.name, bound=bound)


def _is_ordered(program: AssignmentProgram) -> bool:
    """Tell if the precedence has no cycle, and the fixed stages have distinct slots in order."""
    fixed = {i: stage.slots[0] for i, stage in enumerate(program.stages) if len(stage.slots) == 1}
    in_order = all(fixed[i] < fixed[j] for i in fixed for j in fixed if program.precedes[i, j])
    is_distinct = len(set(fixed.values())) == len(fixed)
    return in_order and is_distinct and not program.precedes.diagonal().any()
