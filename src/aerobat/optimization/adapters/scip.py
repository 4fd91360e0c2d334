"""SCIP, an open general solver, as a cross-check."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any, ClassVar

import numpy as np

from aerobat.optimization import big_m
from aerobat.optimization.adapters.confirmation import confirmed
from aerobat.optimization.assignment import AssignmentProgram
from aerobat.optimization.deadline import shorter
from aerobat.optimization.result import AssignmentResult, Status, verified

_MEANING: dict[str, Status] = {"optimal": "optimal", "infeasible": "infeasible"}


class Scip:
    """One binary for each stage and slot, its bounds switched on by big-M or by indicator constraints."""

    name: ClassVar[str] = "scip"
    package: ClassVar[str] = "pyscipopt"
    extra: ClassVar[str | None] = "scip"

    def solve(
        self,
        program: AssignmentProgram,
        *,
        time_limit: float | None = None,
        node_limit: int | None = None,
        start: Sequence[int] | None = None,
    ) -> AssignmentResult:
        """As `Solver.solve`; the result's time is SCIP's own.

        Raises KeyboardInterrupt where SCIP was stopped by one.
        """
        import pyscipopt

        program.check_start(start)
        model = pyscipopt.Model()
        model.hideOutput()
        if (limit := shorter(time_limit)) is not None:
            model.setParam("limits/time", limit)
        if node_limit is not None:
            model.setParam("limits/nodes", node_limit)
        scaling = big_m.scaled(program)
        claim = _ScipModel(pyscipopt, model, scaling.program).claim()
        return confirmed(program, verified(program, scaling.unscaled(claim)))


class _ScipModel:
    """One program in one SCIP model."""

    def __init__(self, pyscipopt: Any, model: Any, program: AssignmentProgram) -> None:
        self._sum = pyscipopt.quicksum
        self._model = model
        self._program = program
        self._x = [model.addVar(lb=None, ub=None) for _ in range(program.num_variables)]
        for row, value in zip(program.equality, program.target.tolist(), strict=True):
            model.addCons(self._product(row) == value)
        lower, upper = program.root_bounds
        for row, low, high in zip(program.rows, lower.tolist(), upper.tolist(), strict=True):
            if high < inf:
                model.addCons(self._product(row) <= high)
            if low > -inf:
                model.addCons(self._product(row) >= low)

    def claim(self) -> AssignmentResult:
        """Build, solve, read."""
        variables = self._add_binaries()
        for indicator in big_m.indicator_constraints(self._program):
            self._add_indicator(indicator, variables[indicator.binary])
        self._set_cost()
        model = self._model
        model.optimize()
        if model.getStatus() == "userinterrupt":
            raise KeyboardInterrupt
        slots = x = None
        if model.getNSols():
            values = {key: model.getVal(binary) for key, binary in variables.items()}
            slots = big_m.chosen_slots(self._program, values)
            x = np.array([model.getVal(variable) for variable in self._x])
        return AssignmentResult(
            status=_MEANING.get(model.getStatus(), "time_limit"),
            backend=Scip.name,
            bound=-inf if x is None else model.getDualbound(),
            x=x,
            slots=slots,
            nodes=int(model.getNTotalNodes()),
            time=float(model.getSolvingTime()),
        )

    def _product(self, row: Any) -> Any:
        terms = [
            coefficient * variable
            for coefficient, variable in zip(row.tolist(), self._x, strict=True)
            if coefficient
        ]
        return self._sum(terms) if terms else 0.0 * self._x[0]

    def _add_binaries(self) -> dict[big_m.StageSlot, Any]:
        model = self._model
        variables = {key: model.addVar(vtype="B") for key in big_m.binaries(self._program)}
        for constraint in big_m.binary_constraints(self._program):
            total = self._sum(coefficient * variables[key] for coefficient, key in constraint.terms)
            model.addCons(total == constraint.bound if constraint.is_equality else total <= constraint.bound)
        return variables

    def _add_indicator(self, indicator: big_m.IndicatorConstraint, binary: Any) -> None:
        row = self._product(indicator.sign * self._program.rows[indicator.row])
        bound, root_bound = indicator.bound, indicator.root_bound
        if root_bound < inf:
            self._model.addCons(row <= root_bound + (bound - root_bound) * binary)
        else:
            self._model.addConsIndicator(row <= bound, binary)

    def _set_cost(self) -> None:
        """Minimize a variable that is above the cost: SCIP's objective is linear."""
        program, x = self._program, self._x
        if program.hessian is None:
            quadratic = self._sum(variable * variable for variable in x)
        else:
            pairs = zip(*np.nonzero(program.hessian), strict=True)
            quadratic = self._sum(0.5 * float(program.hessian[i, j]) * x[i] * x[j] for i, j in pairs)
        cost = self._model.addVar(lb=None, ub=None)
        self._model.addCons(quadratic <= cost)
        linear = 0.0 if program.gradient is None else self._product(program.gradient)
        self._model.setObjective(cost + linear)
        self._model.addObjoffset(program.constant)
