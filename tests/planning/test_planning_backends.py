"""Built-in problems by every back-end and order: the same assignment, or a word that it took too long."""

from __future__ import annotations

import pytest

from aerobat.errors import Infeasible
from aerobat.optimization import solver
from aerobat.optimization.deadline import within_time
from aerobat.planning import Miqp, plan
from aerobat.planning.miqp.miqp import formulate
from aerobat.planning.task import Task
from aerobat.problem import load_problem

SHORT = ("half-flip", "line", "section-v")
LONG = (("flip-roll", 3), ("flip-roll-translation", 4), ("flip-roll", 5), ("split-s", 5))  # many stages


@pytest.mark.parametrize(
    ("name", "order"),
    [
        *((name, order) for name in SHORT for order in (3, 4, 5)),
        *(pytest.param(*case, marks=pytest.mark.peer) for case in LONG),
    ],
)
def test_gurobi_finds_what_the_built_in_search_finds(name: str, order: int) -> None:
    pytest.importorskip("gurobipy")
    problem = load_problem(name)
    own = plan(problem, Miqp(order=order), vehicle=None)
    program = formulate(Task.of(problem), order, 20).program(own.dt)
    exact = solver("builtin").solve(program)
    with within_time(60.0):
        found = solver("gurobi").solve(program)
    assert found.x is not None
    assert exact.x is not None
    assert found.cost == pytest.approx(exact.cost, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "order"),
    [("line", 3), ("line", 4), ("half-flip", 3), pytest.param("half-flip", 4, marks=pytest.mark.peer)],
)
def test_scip_finds_what_the_built_in_search_finds(name: str, order: int) -> None:
    pytest.importorskip("pyscipopt")
    problem = load_problem(name)
    program = formulate(Task.of(problem), order, 8).program(
        plan(problem, Miqp(order=order, intervals=8), vehicle=None).dt
    )
    exact, found = solver("builtin").solve(program), solver("scip").solve(program)
    assert found.backend == "scip"
    assert found.cost == pytest.approx(exact.cost, rel=1e-3)


@pytest.mark.parametrize(("backend", "remedy"), [("builtin", "fewer intervals"), ("scip", "backend builtin")])
def test_a_backend_that_is_too_slow_is_not_told_as_a_maneuver_that_cannot_be(
    backend: str, remedy: str
) -> None:
    if backend == "scip":
        pytest.importorskip("pyscipopt")
    with pytest.raises(Infeasible, match=f"no plan of 'flip-roll' was found in 0 s.*--time-limit.*{remedy}"):
        plan(load_problem("flip-roll"), Miqp(backend=backend, time_limit=0.0), vehicle=None)
