"""The solvers by name, each imported when it is first needed."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches
from importlib import import_module
from importlib.util import find_spec
from typing import ClassVar, Protocol, cast

from aerobat.errors import BackendMissing, SpecError
from aerobat.optimization.assignment import AssignmentProgram
from aerobat.optimization.result import AssignmentResult


class Solver(Protocol):
    """A solver of assignment programs; not thread-safe.

    A back-end is one file with one such class, which declares its package and its capabilities, and one line
    in BACKENDS. The package is imported when `solve` is called.
    """

    name: ClassVar[str]
    package: ClassVar[str]  # the package that it imports
    # the extra of aerobat that installs the package; None where aerobat itself does
    extra: ClassVar[str | None]

    def solve(
        self, program: AssignmentProgram, *, node_limit: int | None = None, start: Sequence[int] | None = None
    ) -> AssignmentResult:
        """Return the assignment of minimum cost, or the best one found by a deadline or the node limit.

        The deadline is that of `deadline.within_time`.

        Args:
            program: the program to solve.
            node_limit: limit of the solved relaxations, as the solver counts them; None sets no limit.
            start: one slot for each stage, an assignment that may be good; SCIP only checks its length.

        Raises:
            SpecError: `start` does not have one slot for each stage.
        """
        ...


BACKENDS = {  # module:class
    "builtin": "aerobat.optimization.branch_and_bound:BranchAndBound",
    "gurobi": "aerobat.optimization.adapters.gurobi:Gurobi",
    "scip": "aerobat.optimization.adapters.scip:Scip",
}


def available_backends() -> tuple[str, ...]:
    """Return the names of the back-ends whose packages are installed."""
    return tuple(name for name in BACKENDS if find_spec(_adapter(name).package) is not None)


def solver(name: str = "builtin") -> Solver:
    """Return a solver. The built-in one is faster if it is kept for programs with the same matrices.

    SpecError is raised for a name that is not in BACKENDS. BackendMissing, with the command that installs the
    package, is raised where the package is missing.
    """
    if name not in BACKENDS:
        near = get_close_matches(name, BACKENDS, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"choose from {', '.join(BACKENDS)}"
        raise SpecError(f"backend '{name}' is unknown; {hint}")
    adapter = _adapter(name)
    if find_spec(adapter.package) is None:
        requirement = "aerobat" if adapter.extra is None else f"aerobat[{adapter.extra}]"
        raise BackendMissing(
            f"backend '{name}' needs the package {adapter.package}; install it with "
            f"pip install '{requirement}' (or uv pip install '{requirement}'), or use --backend builtin"
        )
    return adapter()


def _adapter(name: str) -> type[Solver]:
    module, _, adapter = BACKENDS[name].partition(":")
    return cast(type[Solver], getattr(import_module(module), adapter))
