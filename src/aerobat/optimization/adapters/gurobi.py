"""Gurobi, the general solver that the paper used, as a cross-check."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any, ClassVar

from aerobat.errors import AerobatError
from aerobat.optimization import big_m
from aerobat.optimization.assignment import AssignmentProgram
from aerobat.optimization.deadline import time_left
from aerobat.optimization.result import AssignmentResult, Status

_TOO_LARGE = 10010  # Gurobi's error number for a model beyond the size of the licence


class Gurobi:
    """A solver with a binary for each stage and slot; big-M or indicator constraints enable the bounds.

    Big-M constraints take less time than indicator constraints. The licence in the package allows
    `free_variables` variables, a full licence any number.
    """

    name: ClassVar[str] = "gurobi"
    package: ClassVar[str] = "gurobipy"
    extra: ClassVar[str | None] = "gurobi"
    free_variables: ClassVar[int] = 200  # with a quadratic objective

    def solve(
        self, program: AssignmentProgram, *, node_limit: int | None = None, start: Sequence[int] | None = None
    ) -> AssignmentResult:
        """Solve as `Solver.solve` does. The result's time is Gurobi's own Runtime.

        AerobatError is raised where the licence is missing or too small for the program, KeyboardInterrupt
        where the user interrupted Gurobi.
        """
        import gurobipy

        program.check_start(start)
        scaling = big_m.scaled(program)
        try:
            with gurobipy.Env(empty=True) as env:
                # set before the environment starts, or Gurobi prints the licence's banner
                env.setParam("OutputFlag", 0)
                env.setParam("Threads", 1)
                env.start()
                with gurobipy.Model(env=env) as model:
                    model.Params.FeasibilityTol = model.Params.IntFeasTol = model.Params.MIPGap = 1e-9
                    limit = time_left()
                    model.Params.TimeLimit = inf if limit is None else limit
                    model.Params.NodeLimit = inf if node_limit is None else node_limit
                    claim = _claim(gurobipy, model, scaling.program, start)
        except gurobipy.GurobiError as error:
            raise AerobatError(_message(error, program)) from None
        return scaling.result(claim)


class _GurobiModel:
    """A model of Gurobi for `big_m.build`."""

    def __init__(self, gurobipy: Any, model: Any) -> None:
        self._grb, self._model = gurobipy.GRB, model
        self.total = gurobipy.quicksum

    def variable(self, is_binary: bool = False) -> Any:
        return self._model.addVar(vtype=self._grb.BINARY) if is_binary else self._model.addVar(lb=-inf)

    def add(self, constraint: Any) -> None:
        self._model.addConstr(constraint)

    def add_indicator(self, binary: Any, constraint: Any) -> None:
        self._model.addGenConstrIndicator(binary, True, constraint)

    def minimize(self, cost: Any) -> None:
        self._model.setObjective(cost, self._grb.MINIMIZE)


def _claim(
    gurobipy: Any, model: Any, program: AssignmentProgram, start: Sequence[int] | None
) -> AssignmentResult:
    """Build the model, solve it, and return the result."""
    variables, grb = big_m.build(_GurobiModel(gurobipy, model), program), gurobipy.GRB
    if start is not None:
        for (stage, slot), binary in variables.binaries.items():
            binary.Start = float(slot == start[stage])
    model.optimize()
    if model.Status == grb.INTERRUPTED:
        raise KeyboardInterrupt
    meaning: dict[int, Status] = {
        grb.OPTIMAL: "optimal",
        grb.INFEASIBLE: "infeasible",
        grb.INF_OR_UNBD: "infeasible",  # not unbounded: the cost has a minimum
    }
    x, slots = variables.values(lambda each: float(each.X)) if model.SolCount else (None, None)
    return AssignmentResult(
        status=meaning.get(model.Status, "time_limit"),
        backend=Gurobi.name,
        bound=-inf if x is None else model.ObjBound,
        x=x,
        slots=slots,
        nodes=int(model.NodeCount) if model.IsMIP else 0,
        time=model.Runtime,
    )


def _message(error: Any, program: AssignmentProgram) -> str:
    if error.errno != _TOO_LARGE:
        return f"Gurobi failed: {error}"
    size = program.num_variables + sum(len(stage.slots) for stage in program.stages)
    return (
        f"Gurobi's free licence takes {Gurobi.free_variables} variables with a quadratic objective and this "
        f"program has {size}; use fewer intervals, a full licence, or the 'builtin' backend"
    )
