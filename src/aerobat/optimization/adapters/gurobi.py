"""Gurobi, the general solver that the paper used, as a cross-check."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any, ClassVar

import numpy as np

from aerobat.errors import AerobatError
from aerobat.optimization import big_m
from aerobat.optimization.adapters.confirmation import confirmed
from aerobat.optimization.assignment import AssignmentProgram
from aerobat.optimization.deadline import shorter
from aerobat.optimization.result import AssignmentResult, Status, verified

_TOO_LARGE = 10010  # Gurobi's error number for a model beyond the size of the licence
_PARAMETERS = {"FeasibilityTol": 1e-9, "IntFeasTol": 1e-9, "MIPGap": 1e-9}


class Gurobi:
    """One binary for each stage and slot, its bounds switched on by big-M or by indicator constraints.

    Big-M takes less time than indicator constraints. The licence that comes with the package takes
    `free_variables` variables, a full one any number.
    """

    name: ClassVar[str] = "gurobi"
    package: ClassVar[str] = "gurobipy"
    extra: ClassVar[str | None] = "gurobi"
    free_variables: ClassVar[int] = 200  # with a quadratic objective

    def solve(
        self,
        program: AssignmentProgram,
        *,
        time_limit: float | None = None,
        node_limit: int | None = None,
        start: Sequence[int] | None = None,
    ) -> AssignmentResult:
        """As `Solver.solve`; the result's time is Gurobi's own Runtime.

        Raises AerobatError where the licence is missing or too small for the program, KeyboardInterrupt
        where Gurobi was stopped by one.
        """
        import gurobipy

        program.check_start(start)
        scaling = big_m.scaled(program)
        try:
            with gurobipy.Env(empty=True) as env:
                env.setParam("OutputFlag", 0)  # before it starts, or it prints the licence's banner
                env.setParam("Threads", 1)
                env.start()
                with gurobipy.Model(env=env) as model:
                    limit = shorter(time_limit)
                    model.Params.TimeLimit = inf if limit is None else limit
                    model.Params.NodeLimit = inf if node_limit is None else node_limit
                    claim = _GurobiModel(gurobipy, model, scaling.program).claim(start)
        except gurobipy.GurobiError as error:
            raise AerobatError(_message(error, program)) from None
        return confirmed(program, verified(program, scaling.unscaled(claim)))


class _GurobiModel:
    """One program in one Gurobi model."""

    def __init__(self, gurobipy: Any, model: Any, program: AssignmentProgram) -> None:
        self._sum = gurobipy.quicksum
        self._grb = gurobipy.GRB
        self._model = model
        self._program = program
        for name, value in _PARAMETERS.items():
            model.setParam(name, value)
        self._x = model.addMVar(program.num_variables, lb=-inf)
        model.addConstr(program.equality @ self._x == program.target)
        for sign, bounds in zip((-1, 1), program.root_bounds, strict=True):
            finite = np.isfinite(bounds)
            model.addConstr((sign * program.rows[finite]) @ self._x <= sign * bounds[finite])

    def claim(self, start: Sequence[int] | None) -> AssignmentResult:
        """Build, solve, read."""
        variables = self._add_binaries(start)
        for indicator in big_m.indicator_constraints(self._program):
            self._add_indicator(indicator, variables[indicator.binary])
        self._set_cost()
        model = self._model
        model.optimize()
        if model.Status == self._grb.INTERRUPTED:
            raise KeyboardInterrupt
        meaning: dict[int, Status] = {
            self._grb.OPTIMAL: "optimal",
            self._grb.INFEASIBLE: "infeasible",
            self._grb.INF_OR_UNBD: "infeasible",  # the cost has a minimum
        }
        slots = x = None
        if model.SolCount:
            slots = big_m.chosen_slots(self._program, {key: binary.X for key, binary in variables.items()})
            x = self._x.X
        return AssignmentResult(
            status=meaning.get(model.Status, "time_limit"),
            backend=Gurobi.name,
            bound=-inf if x is None else model.ObjBound,
            x=x,
            slots=slots,
            nodes=int(model.NodeCount) if model.IsMIP else 0,
            time=model.Runtime,
        )

    def _set_cost(self) -> None:
        program, x = self._program, self._x
        cost = x @ x if program.hessian is None else 0.5 * (x @ program.hessian @ x)
        if program.gradient is not None:
            cost = cost + program.gradient @ x
        self._model.setObjective(cost + program.constant, self._grb.MINIMIZE)

    def _add_binaries(self, start: Sequence[int] | None) -> dict[big_m.StageSlot, Any]:
        model = self._model
        variables = {key: model.addVar(vtype=self._grb.BINARY) for key in big_m.binaries(self._program)}
        if start is not None:
            for (stage, slot), variable in variables.items():
                variable.Start = float(slot == start[stage])
        for constraint in big_m.binary_constraints(self._program):
            total = self._sum(coefficient * variables[key] for coefficient, key in constraint.terms)
            model.addConstr(
                total == constraint.bound if constraint.is_equality else total <= constraint.bound
            )
        return variables

    def _add_indicator(self, indicator: big_m.IndicatorConstraint, binary: Any) -> None:
        row = (indicator.sign * self._program.rows[indicator.row]) @ self._x
        bound, root_bound = indicator.bound, indicator.root_bound
        if root_bound < inf:
            self._model.addConstr(row <= root_bound + (bound - root_bound) * binary)
        else:
            self._model.addGenConstrIndicator(binary, True, row.item() <= bound)


def _message(error: Any, program: AssignmentProgram) -> str:
    if error.errno != _TOO_LARGE:
        return f"Gurobi failed: {error}"
    size = program.num_variables + len(big_m.binaries(program))
    return (
        f"Gurobi's free licence takes {Gurobi.free_variables} variables with a quadratic objective and this "
        f"program has {size}; use fewer intervals, a full licence, or the 'builtin' backend"
    )
