"""The built-in solver: a direct search and, where a proof takes long, one that cuts the sequence in two.

The cut search serves proofs. Programs reach it whose stages have an order, three of which confine a
position, and of which the optimum is asked without a limit of nodes: those of `plan(problem)` without a
vehicle, and those of `Miqp(search=...)`. The scan of `Miqp` for a vehicle ends each search after a few
hundred nodes, because its paths begin at slots that need not be the cheapest. Stages of more than three
places go in windows (`moving_window`), and those of `--paper` have no order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf
from time import perf_counter
from typing import ClassVar

from aerobat.optimization.assignment import AssignmentProgram
from aerobat.optimization.branch_and_bound.direct_search import NAME, DirectSearch
from aerobat.optimization.branch_and_bound.search import SearchLimits
from aerobat.optimization.branch_and_bound.time_decomposition import TimeDecomposition, cut_stage
from aerobat.optimization.deadline import shorter
from aerobat.optimization.result import AssignmentResult, verified

# chosen on three free gates by benchmarks/growth_with_stages.py; docs/lab/benchmarks.md has the counts
DIRECT_NODES = 300  # of a direct search, before the sequence is cut in two
MIN_NODES = 6000  # of all: with fewer no proof comes of a cut, and the bound is the worse for it


class BranchAndBound:
    """Solves assignment programs exactly, and keeps factorizations for the next with the same matrices.

    Not for several threads at once: give each its own. DERIVATION.md beside this file says how it works and
    why it is right.
    """

    name: ClassVar[str] = NAME
    package: ClassVar[str] = "daqp"
    extra: ClassVar[str | None] = None
    uses_start: ClassVar[bool] = True

    def __init__(self) -> None:
        """Begin without factorizations."""
        self._direct = DirectSearch()

    def solve(
        self,
        program: AssignmentProgram,
        *,
        time_limit: float | None = None,
        node_limit: int | None = None,
        start: Sequence[int] | None = None,
    ) -> AssignmentResult:
        """As `Solver.solve`; the result's time is that of the whole call."""
        program.check_start(start)
        began = perf_counter()
        limit = shorter(time_limit)
        deadline = inf if limit is None else began + limit
        limits = SearchLimits(deadline, inf if node_limit is None else node_limit)
        result = verified(program, self._claim(program, limits, start))
        return replace(result, time=perf_counter() - began)

    def _claim(
        self, program: AssignmentProgram, limits: SearchLimits, start: Sequence[int] | None
    ) -> AssignmentResult:
        stage = cut_stage(program) if limits.nodes >= MIN_NODES else None
        if stage is None:
            return self._direct.claim(program, limits, start)
        first = self._direct.claim(program, replace(limits, nodes=DIRECT_NODES), start)
        if first.status in ("optimal", "infeasible") or perf_counter() >= limits.deadline:
            return first
        if first.slots is None:  # nothing to begin with
            return self._direct.claim(program, limits, start)
        return TimeDecomposition(program, stage, first, limits, self._direct).run()
