"""The built-in solver: a convex QP for what no choice touches, an exact search over slots for the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf
from time import perf_counter
from typing import ClassVar

import numpy as np

from aerobat.optimization.assignment import AssignmentProgram, Mask
from aerobat.optimization.branch_and_bound.candidates import Candidates
from aerobat.optimization.branch_and_bound.least_distance import LeastDistanceQP, NotConverged, QPSolution
from aerobat.optimization.branch_and_bound.lower_bounds import DualBounds
from aerobat.optimization.branch_and_bound.null_space import NullSpace, ReducedBounds, split_coupled
from aerobat.optimization.branch_and_bound.search import BestFirstSearch
from aerobat.optimization.result import AssignmentResult, Status, verified

_MATRICES = ("rows", "equality", "hessian", "gradient")
_EQUALITY_TOLERANCE = 1e-12  # bounds closer than this, relative to the larger, make an equality
_CONTRADICTION_TOLERANCE = 1e-9  # on the same scale, by which a lower bound must exceed the upper one


class BranchAndBound:
    """Solves assignment programs exactly, and keeps factorizations for the next with the same matrices.

    Not for several threads at once: give each its own. DERIVATION.md beside this file says how it works and
    why it is right.
    """

    name: ClassVar[str] = "builtin"
    package: ClassVar[str] = "daqp"
    extra: ClassVar[str | None] = None
    uses_start: ClassVar[bool] = True

    _factorization: _Factorization | None = None

    def solve(
        self,
        program: AssignmentProgram,
        *,
        time_limit: float | None = None,
        start: Sequence[int] | None = None,
    ) -> AssignmentResult:
        """Return the assignment of minimum cost, or the best one found within `time_limit`.

        Args:
            program: what to solve.
            time_limit: [s]; None sets no limit.
            start: one slot a stage, tried first: what costs more is then not searched.

        Raises:
            SpecError: `start` has not one slot a stage.
        """
        program.check_start(start)
        began = perf_counter()
        deadline = inf if time_limit is None else began + time_limit
        result = verified(program, self._claim(program, deadline, start))
        return replace(result, time=perf_counter() - began)

    def _claim(
        self, program: AssignmentProgram, deadline: float, start: Sequence[int] | None
    ) -> AssignmentResult:
        lower, upper = program.root_bounds
        larger = np.maximum(np.abs(lower), np.abs(upper))
        scale = np.where(np.isfinite(larger), larger, 0.0)
        if (lower - upper > _CONTRADICTION_TOLERANCE * scale).any() or not _is_ordered(program):
            return _without_solution("infeasible", inf)
        implicit_equalities = upper - lower <= _EQUALITY_TOLERANCE * scale
        kept = self._factorization
        if kept is None or not kept.fits(program, implicit_equalities):
            kept = _Factorization(program, implicit_equalities)
            self._factorization = kept
        root = kept.coupled.bounds(program, lower, upper)
        independent = kept.independent.bounds(program, lower, upper)
        if not (root.consistent and independent.consistent):
            return _without_solution("infeasible", inf)
        independent = independent.in_units(independent.min_norm or 1.0)
        try:
            solution = kept.independent_qp.solve(independent.lower, independent.upper)
        except NotConverged:
            return _without_solution("unknown", -inf)
        if solution is None:
            return _without_solution("infeasible", inf)
        return _Prepared(program, kept, root, independent, solution).search(deadline, start)


class _Factorization:
    """What depends on the matrices, on which rows are equalities and on the rows of the stages alone."""

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
        """Tell if another program has the same matrices, and the same rows in the same roles."""
        own = self._program
        if own.precedence != program.precedence or len(own.stages) != len(program.stages):
            return False
        stages = zip(own.stages, program.stages, strict=True)
        return (
            all(getattr(own, name) is getattr(program, name) for name in _MATRICES)
            and np.array_equal(self._implicit_equalities, implicit_equalities)
            and all(a.slots == b.slots and np.array_equal(a.rows, b.rows) for a, b in stages)
        )


@dataclass(frozen=True, eq=False)
class _Prepared:
    """A program ready to be searched."""

    program: AssignmentProgram
    kept: _Factorization
    root: ReducedBounds  # of the block that stages with several slots couple
    independent: ReducedBounds  # of the other block,
    independent_solution: QPSolution  # which is solved

    def search(self, deadline: float, start: Sequence[int] | None) -> AssignmentResult:
        """Search until the deadline."""
        kept = self.kept
        program = self.program
        bounds = kept.candidates.bounds(program, kept.coupled, self.root)
        unit = max(self.root.min_norm, kept.candidates.min_norm(bounds)) or 1.0
        root = self.root.in_units(unit)
        search = BestFirstSearch(
            kept.candidates, kept.dual_bounds, kept.coupled_qp, bounds.in_units(unit), root
        )
        if start is not None:
            search.try_start({stage: start[stage] for stage in kept.candidates.free_stages})
        search.run(deadline)
        base_cost = program.constant + self.independent.cost(self.independent_solution.value)
        bound = base_cost + root.cost(search.bound)
        if search.best is None:
            return replace(_without_solution(search.status, bound), nodes=search.nodes)
        solution, chosen = search.best
        x = np.zeros(program.num_variables)
        x[kept.coupled.columns] = kept.coupled.expand(root, solution.y)
        x[kept.independent.columns] = kept.independent.expand(self.independent, self.independent_solution.y)
        slots = [stage.slots[0] for stage in program.stages]
        for candidate in chosen:
            slots[kept.candidates.stage[candidate]] = int(kept.candidates.slot[candidate])
        return AssignmentResult(
            status=search.status,
            backend=BranchAndBound.name,
            bound=bound,
            x=x,
            slots=tuple(slots),
            nodes=search.nodes,
        )


def _without_solution(status: Status, bound: float) -> AssignmentResult:
    return AssignmentResult(status=status, backend=BranchAndBound.name, bound=bound)


def _is_ordered(program: AssignmentProgram) -> bool:
    """Tell if the precedence has no cycle and the fixed stages have distinct slots, in order."""
    fixed = {i: stage.slots[0] for i, stage in enumerate(program.stages) if len(stage.slots) == 1}
    in_order = all(fixed[i] < fixed[j] for i in fixed for j in fixed if program.precedes[i, j])
    is_distinct = len(set(fixed.values())) == len(fixed)
    return in_order and is_distinct and not program.precedes.diagonal().any()
