"""A general solver's "infeasible" is a claim; the exact search confirms or refutes it."""

from __future__ import annotations

import pytest

from aerobat.optimization import solver
from paper_program import HALF_FLIP, half_flip

FEASIBLE = half_flip(HALF_FLIP, dt=0.18)
INFEASIBLE = half_flip(HALF_FLIP, dt=0.1)


@pytest.fixture(params=["scip", "gurobi"])
def denying(request, monkeypatch):
    """The name of a back-end whose solver says of every program that it has no solution."""
    if request.param == "scip":
        pyscipopt = pytest.importorskip("pyscipopt")

        class Denying(pyscipopt.Model):
            def getNSols(self) -> int:
                return 0

            def getStatus(self) -> str:
                return "infeasible"

        monkeypatch.setattr(pyscipopt, "Model", Denying)
    else:
        gurobipy = pytest.importorskip("gurobipy")

        class Denying(gurobipy.Model):
            SolCount = 0
            Status = gurobipy.GRB.INFEASIBLE

        monkeypatch.setattr(gurobipy, "Model", Denying)
    return request.param


def test_a_false_claim_of_infeasibility_is_refuted_by_a_solution(denying: str) -> None:
    found, exact = solver(denying).solve(FEASIBLE), solver().solve(FEASIBLE)
    assert found.x is not None
    assert (found.status, found.backend) == ("optimal", "builtin")
    assert found.cost == exact.cost
    assert FEASIBLE.violation(found.x, found.slots) < 1e-9


def test_a_true_claim_of_infeasibility_is_the_adapters(denying: str) -> None:
    found = solver(denying).solve(INFEASIBLE)
    assert (found.status, found.backend, found.x) == ("infeasible", denying, None)


def test_gurobi_still_finds_what_it_finds() -> None:
    pytest.importorskip("gurobipy")
    assert solver("gurobi").solve(FEASIBLE).backend == "gurobi"
