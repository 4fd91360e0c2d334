"""Gurobi, the general solver that the paper used, as a cross-check."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Any, ClassVar

import numpy as np

from aerobat.errors import AerobatError
from aerobat.optimization.assignment import AssignmentProgram, AssignmentResult, Status, certified
from aerobat.optimization.big_m import (
    Switch,
    chosen_slots,
    conditioned,
    slots_taken,
    standing_bounds,
    switches,
)

_TOO_LARGE = 10010  # Gurobi's error number for a model beyond the size of the licence
_STRICT = {"FeasibilityTol": 1e-9, "IntFeasTol": 1e-9, "MIPGap": 1e-9}


@dataclass(frozen=True)
class Gurobi:
    """One binary for each stage and slot.

    The bounds of a placement are switched on by big-M where there are standing bounds, which takes less time
    than indicator constraints, and by those where there are none. The licence that comes with the package
    takes `free_variables` variables, a full one any number.
    """

    name: ClassVar[str] = "gurobi"
    free_variables: ClassVar[int] = 200  # with a quadratic objective

    threads: int = 1

    def solve(
        self,
        program: AssignmentProgram,
        *,
        time_limit: float | None = None,
        start: Sequence[int] | None = None,
    ) -> AssignmentResult:
        """The cheapest assignment, or the best one found within `time_limit` [s].

        `start` are slots that may be good. The result's time is Gurobi's own Runtime. Raises
        AerobatError where the licence is missing or too small for the program.
        """
        import gurobipy

        program.check_start(start)
        scaled = conditioned(program)
        try:
            with gurobipy.Env(empty=True) as env:
                env.setParam("OutputFlag", 0)  # before it starts, or it prints the licence's banner
                env.setParam("Threads", self.threads)
                env.start()
                with gurobipy.Model(env=env) as model:
                    model.Params.TimeLimit = inf if time_limit is None else time_limit
                    claim = _Run(gurobipy, model, scaled.program).claim(start)
        except gurobipy.GurobiError as error:
            raise AerobatError(_explained(error, program)) from None
        return certified(program, scaled.restored(claim))


class _Run:
    """One program in one Gurobi model."""

    def __init__(self, gurobipy: Any, model: Any, program: AssignmentProgram) -> None:
        self._gurobipy, self._grb, self._model, self._program = gurobipy, gurobipy.GRB, model, program
        for name, value in _STRICT.items():
            model.setParam(name, value)
        self._x = model.addMVar(program.variables, lb=-inf)
        self._bounds = dict(zip((-1, 1), standing_bounds(program), strict=True))
        model.addConstr(program.equality @ self._x == program.target)
        for sign, bounds in self._bounds.items():
            given = np.isfinite(bounds)
            model.addConstr((sign * program.rows[given]) @ self._x <= sign * bounds[given])

    def claim(self, start: Sequence[int] | None) -> AssignmentResult:
        """Build, solve, read."""
        program, model = self._program, self._model
        binaries = self._add_binaries(start)
        for switch in switches(program):
            self._add_switch(switch, binaries[switch.stage, switch.slot])
        self._set_cost()
        model.optimize()
        status = self._status()
        if not model.SolCount:
            proven = status == "infeasible"
            return self._result("infeasible" if proven else "unknown", None, None, inf if proven else -inf)
        slots = chosen_slots(program, {key: binary.X for key, binary in binaries.items()})
        return self._result(status, self._x.X, slots, model.ObjBound)

    def _status(self) -> Status:
        meaning: dict[int, Status] = {
            self._grb.OPTIMAL: "optimal",
            self._grb.INFEASIBLE: "infeasible",
            self._grb.INF_OR_UNBD: "infeasible",  # the cost has a minimum
        }
        return meaning.get(self._model.Status, "time_limit")

    def _set_cost(self) -> None:
        program, x = self._program, self._x
        cost = x @ x if program.hessian is None else 0.5 * (x @ program.hessian @ x)
        if program.gradient is not None:
            cost = cost + program.gradient @ x
        self._model.setObjective(cost + program.constant, self._grb.MINIMIZE)

    def _add_binaries(self, start: Sequence[int] | None) -> dict[tuple[int, int], Any]:
        model, total, program = self._model, self._gurobipy.quicksum, self._program
        keys = [(i, slot) for i, stage in enumerate(program.stages) for slot in stage.slots]
        binaries = {key: model.addVar(vtype=self._grb.BINARY) for key in keys}
        for i, stage in enumerate(program.stages):
            model.addConstr(total(binaries[i, slot] for slot in stage.slots) == 1)
            if start is not None:
                for slot in stage.slots:
                    binaries[i, slot].Start = float(slot == start[i])
        for users in slots_taken(program):
            model.addConstr(total(binaries[user] for user in users) <= 1)
        for i, j in program.precedence:
            first, second = (total(s * binaries[k, s] for s in program.stages[k].slots) for k in (i, j))
            model.addConstr(first + 1 <= second)
        return binaries

    def _add_switch(self, switch: Switch, binary: Any) -> None:
        sign, bound = switch.sign, switch.sign * switch.bound
        row, most = (sign * self._program.rows[switch.row]) @ self._x, sign * self._bounds[sign][switch.row]
        if most < inf:
            self._model.addConstr(row <= most + (bound - most) * binary)
        else:
            self._model.addGenConstrIndicator(binary, True, row.item() <= bound)

    def _result(
        self, status: Status, x: Any, slots: tuple[int, ...] | None, bound: float
    ) -> AssignmentResult:
        nodes = int(self._model.NodeCount) if self._model.IsMIP else 0
        return AssignmentResult(status, x, slots, inf, bound, nodes, self._model.Runtime, Gurobi.name)


def _explained(error: Any, program: AssignmentProgram) -> str:
    if error.errno != _TOO_LARGE:
        return f"Gurobi failed: {error}"
    size = program.variables + sum(len(stage.slots) for stage in program.stages)
    return (
        f"Gurobi's free licence takes {Gurobi.free_variables} variables with a quadratic objective and this "
        f"program has {size}; use fewer intervals, a full licence, or the 'builtin' backend"
    )
