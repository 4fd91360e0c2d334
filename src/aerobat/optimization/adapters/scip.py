"""SCIP, an open general solver, as a cross-check."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any, ClassVar

from aerobat.optimization import big_m
from aerobat.optimization.assignment import AssignmentProgram
from aerobat.optimization.deadline import time_left
from aerobat.optimization.result import AssignmentResult, Status

_MEANING: dict[str, Status] = {"optimal": "optimal", "infeasible": "infeasible"}


class Scip:
    """A solver with a binary for each stage and slot; big-M or indicator constraints enable the bounds."""

    name: ClassVar[str] = "scip"
    package: ClassVar[str] = "pyscipopt"
    extra: ClassVar[str | None] = "scip"

    def solve(
        self, program: AssignmentProgram, *, node_limit: int | None = None, start: Sequence[int] | None = None
    ) -> AssignmentResult:
        """Solve as `Solver.solve` does. The result's time is SCIP's own.

        KeyboardInterrupt is raised where the user interrupted SCIP.
        """
        import pyscipopt

        program.check_start(start)
        model = pyscipopt.Model()
        model.hideOutput()
        if (limit := time_left()) is not None:
            model.setParam("limits/time", limit)
        if node_limit is not None:
            model.setParam("limits/nodes", node_limit)
        scaling = big_m.scaled(program)
        claim = _claim(pyscipopt, model, scaling.program)
        return scaling.result(claim)


class _ScipModel:
    """A model of SCIP for `big_m.build`."""

    def __init__(self, pyscipopt: Any, model: Any) -> None:
        self._model = model
        self.total = pyscipopt.quicksum

    def variable(self, is_binary: bool = False) -> Any:
        return self._model.addVar(vtype="B") if is_binary else self._model.addVar(lb=None, ub=None)

    def add(self, constraint: Any) -> None:
        self._model.addCons(constraint)

    def add_indicator(self, binary: Any, constraint: Any) -> None:
        self._model.addConsIndicator(constraint, binary)

    def minimize(self, cost: Any) -> None:
        """Minimize an extra variable that is at least the quadratic cost: SCIP's objective is linear."""
        bound = self.variable()
        self.add(cost <= bound)
        self._model.setObjective(bound)


def _claim(pyscipopt: Any, model: Any, program: AssignmentProgram) -> AssignmentResult:
    """Build the model, solve it, and return the result."""
    variables = big_m.build(_ScipModel(pyscipopt, model), program)
    model.optimize()
    if model.getStatus() == "userinterrupt":
        raise KeyboardInterrupt
    x, slots = variables.values(model.getVal) if model.getNSols() else (None, None)
    return AssignmentResult(
        status=_MEANING.get(model.getStatus(), "time_limit"),
        backend=Scip.name,
        bound=-inf if x is None else model.getDualbound(),
        x=x,
        slots=slots,
        nodes=int(model.getNTotalNodes()),
        time=float(model.getSolvingTime()),
    )
