"""The solvers by name, each imported when it is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from importlib.util import find_spec
from typing import Protocol, cast

from aerobat.errors import BackendMissing, SpecError
from aerobat.optimization.assignment import AssignmentProgram, AssignmentResult


class Solver(Protocol):
    """Solves assignment programs; not for several threads at once."""

    def solve(
        self,
        program: AssignmentProgram,
        *,
        time_limit: float | None = None,
        start: Sequence[int] | None = None,
    ) -> AssignmentResult:
        """The cheapest assignment, or the best one found within `time_limit` [s].

        `start`, one slot a stage, is an assignment that may be good; a solver may try it first.
        """
        ...


@dataclass(frozen=True)
class Backend:
    """Where a solver is, and what it needs."""

    module: str
    solver: str  # its class there
    package: str  # what it imports
    extra: str | None = None  # of aerobat, which installs the package


BACKENDS = {
    "builtin": Backend("aerobat.optimization.branch_and_bound.stage_search", "StageSearch", "daqp"),
    "gurobi": Backend("aerobat.optimization.gurobi", "Gurobi", "gurobipy", "gurobi"),
    "scip": Backend("aerobat.optimization.scip", "Scip", "pyscipopt", "scip"),
}


def available() -> tuple[str, ...]:
    """The names of the backends whose packages are installed."""
    return tuple(name for name, backend in BACKENDS.items() if find_spec(backend.package) is not None)


def solver(name: str = "builtin") -> Solver:
    """A solver; keep it for a series of programs with the same matrices, the built-in one is then faster.

    Raises SpecError for a name that is not in BACKENDS and BackendMissing, with the command that installs it,
    for one whose package is not there.
    """
    backend = BACKENDS.get(name)
    if backend is None:
        near = get_close_matches(name, BACKENDS, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"choose from {', '.join(BACKENDS)}"
        raise SpecError(f"backend '{name}' is unknown; {hint}")
    if find_spec(backend.package) is None:
        wanted = "aerobat" if backend.extra is None else f"aerobat[{backend.extra}]"
        raise BackendMissing(
            f"backend '{name}' needs the package {backend.package}; install it with "
            f"pip install '{wanted}' (or uv pip install '{wanted}'), or use --backend builtin"
        )
    return cast(Solver, getattr(import_module(backend.module), backend.solver)())
