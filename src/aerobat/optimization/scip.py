"""SCIP, an open general solver, as a cross-check."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Any, ClassVar

import numpy as np

from aerobat.optimization.assignment import AssignmentProgram, AssignmentResult, Status, certified
from aerobat.optimization.big_m import (
    Switch,
    chosen_slots,
    conditioned,
    slots_taken,
    standing_bounds,
    switches,
)

_MEANING: dict[str, Status] = {"optimal": "optimal", "infeasible": "infeasible"}


@dataclass(frozen=True)
class Scip:
    """One binary for each stage and slot, the bounds of a placement switched on by big-M or indicators."""

    name: ClassVar[str] = "scip"

    def solve(
        self,
        program: AssignmentProgram,
        *,
        time_limit: float | None = None,
        start: Sequence[int] | None = None,
    ) -> AssignmentResult:
        """The cheapest assignment, or the best one found within `time_limit` [s]; `start` is not used."""
        import pyscipopt

        model = pyscipopt.Model()
        model.hideOutput()
        if time_limit is not None:
            model.setParam("limits/time", time_limit)
        scaled = conditioned(program)
        return certified(program, scaled.restored(_Run(pyscipopt, model, scaled.program).claim()))


class _Run:
    """One program in one SCIP model."""

    def __init__(self, pyscipopt: Any, model: Any, program: AssignmentProgram) -> None:
        self._total, self._model, self._program = pyscipopt.quicksum, model, program
        self._x = [model.addVar(lb=None, ub=None) for _ in range(program.variables)]
        self._lower, self._upper = standing_bounds(program)
        for row, value in zip(program.equality, program.target.tolist(), strict=True):
            model.addCons(self._reach(row) == value)
        for row, low, high in zip(program.rows, self._lower.tolist(), self._upper.tolist(), strict=True):
            if high < inf:
                model.addCons(self._reach(row) <= high)
            if low > -inf:
                model.addCons(self._reach(row) >= low)

    def claim(self) -> AssignmentResult:
        """Build, solve, read."""
        program, model = self._program, self._model
        binaries = self._add_binaries()
        for switch in switches(program):
            self._add_switch(switch, binaries[switch.stage, switch.slot])
        self._set_cost()
        model.optimize()
        status = _MEANING.get(model.getStatus(), "time_limit")
        if not model.getNSols():
            proven = status == "infeasible"
            return self._result("infeasible" if proven else "unknown", None, None, inf if proven else -inf)
        slots = chosen_slots(program, {key: model.getVal(binary) for key, binary in binaries.items()})
        x = np.array([model.getVal(variable) for variable in self._x])
        return self._result(status, x, slots, model.getDualbound())

    def _reach(self, row: Any) -> Any:
        terms = [
            coefficient * variable
            for coefficient, variable in zip(row.tolist(), self._x, strict=True)
            if coefficient
        ]
        return self._total(terms) if terms else 0.0 * self._x[0]

    def _add_binaries(self) -> dict[tuple[int, int], Any]:
        model, total, program = self._model, self._total, self._program
        keys = [(i, slot) for i, stage in enumerate(program.stages) for slot in stage.slots]
        binaries = {key: model.addVar(vtype="B") for key in keys}
        for i, stage in enumerate(program.stages):
            model.addCons(total(binaries[i, slot] for slot in stage.slots) == 1)
        for users in slots_taken(program):
            model.addCons(total(binaries[user] for user in users) <= 1)
        for i, j in program.precedence:
            first, second = (total(s * binaries[k, s] for s in program.stages[k].slots) for k in (i, j))
            model.addCons(first + 1 <= second)
        return binaries

    def _add_switch(self, switch: Switch, binary: Any) -> None:
        row, bound = self._reach(switch.sign * self._program.rows[switch.row]), switch.sign * switch.bound
        most = float(self._upper[switch.row]) if switch.sign > 0 else -float(self._lower[switch.row])
        if most < inf:
            self._model.addCons(row <= most + (bound - most) * binary)
        else:
            self._model.addConsIndicator(row <= bound, binary)

    def _set_cost(self) -> None:
        """Above a variable: SCIP's objective is linear."""
        program, x, total = self._program, self._x, self._total
        if program.hessian is None:
            quadratic = total(variable * variable for variable in x)
        else:
            pairs = zip(*np.nonzero(program.hessian), strict=True)
            quadratic = total(0.5 * float(program.hessian[i, j]) * x[i] * x[j] for i, j in pairs)
        cost = self._model.addVar(lb=None, ub=None)
        self._model.addCons(quadratic <= cost)
        gradient = np.zeros(program.variables) if program.gradient is None else program.gradient
        linear = total(
            slope * variable for slope, variable in zip(gradient.tolist(), x, strict=True) if slope
        )
        self._model.setObjective(cost + linear)
        self._model.addObjoffset(program.constant)

    def _result(
        self, status: Status, x: Any, slots: tuple[int, ...] | None, bound: float
    ) -> AssignmentResult:
        nodes, time = int(self._model.getNTotalNodes()), float(self._model.getSolvingTime())
        return AssignmentResult(status, x, slots, inf, bound, nodes, time, Scip.name)
