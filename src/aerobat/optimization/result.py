"""Results of solvers, and their verification against the program."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf
from typing import Literal

from aerobat.arrays import Array, frozen
from aerobat.optimization.assignment import AssignmentProgram

Status = Literal["optimal", "locally optimal", "time_limit", "infeasible", "unknown"]

# largest residual of a row a x <= b, relative to |a| |x| + |b|, of a valid solution
VIOLATION_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False, kw_only=True)
class AssignmentResult:
    """The outcome of a solve. Cost and violation are recomputed from the program, not taken from the solver.

    "optimal": x is feasible and no other solution costs less. "locally optimal": no window of consecutive
    stages can be improved while the other stages keep their slots. "time_limit": the search ended early, x is
    the best solution found. In the last two cases the cost is within `gap` of the bound. "infeasible": there
    is no x. "unknown": no x was found, which proves nothing.
    """

    status: Status
    backend: str
    bound: float  # lower bound of the cost
    x: Array | None = None  # (n,)
    slots: tuple[int, ...] | None = None  # one for each stage
    cost: float = inf  # infinite without x
    nodes: int = 0  # relaxations solved
    time: float = 0.0  # [s], as the solver itself reports it
    max_violation: float = 0.0  # of any row a x <= b, relative to |a| |x| + |b|

    @property
    def gap(self) -> float:
        """The optimality gap: the fraction (cost − bound) / |cost| of the cost; infinite without x."""
        return inf if self.x is None else max(0.0, self.cost - self.bound) / max(abs(self.cost), 1e-12)


def verified(program: AssignmentProgram, claim: AssignmentResult) -> AssignmentResult:
    """Return a solver's claim with cost and violation recomputed from the program.

    An x that violates a row by more than VIOLATION_TOLERANCE is dropped, and the status becomes "unknown".
    """
    if claim.x is None or claim.slots is None:
        if claim.status == "infeasible":
            return replace(claim, bound=inf)
        return replace(claim, status="unknown")
    violation = program.violation(claim.x, claim.slots)
    if not violation <= VIOLATION_TOLERANCE:
        return replace(claim, status="unknown", x=None, slots=None, cost=inf, max_violation=violation)
    cost = program.cost(claim.x)
    x = frozen(claim.x, "x")
    return replace(claim, x=x, cost=cost, bound=min(claim.bound, cost), max_violation=violation)
