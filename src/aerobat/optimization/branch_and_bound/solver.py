"""The built-in solver: exact, its answers verified."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf
from time import perf_counter
from typing import ClassVar

from aerobat.optimization.assignment import AssignmentProgram
from aerobat.optimization.branch_and_bound.direct_search import NAME, DirectSearch
from aerobat.optimization.branch_and_bound.search import SearchLimits
from aerobat.optimization.deadline import shorter
from aerobat.optimization.result import AssignmentResult, verified


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
        result = verified(program, self._direct.claim(program, limits, start))
        return replace(result, time=perf_counter() - began)
