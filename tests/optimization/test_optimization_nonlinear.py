"""Nonlinear programs: the optimum is one, the evidence is recomputed, and failure is said."""

from __future__ import annotations

import importlib.util
from math import inf

import numpy as np
import pytest

from aerobat.errors import BackendMissing, SpecError
from aerobat.optimization.nonlinear import NonlinearProgram, import_casadi, solve_nonlinear

pytest.importorskip("casadi")


def _program(**changes):
    """Rosenbrock's valley within the unit disc: the optimum lies on the circle."""
    ca = import_casadi()
    x = ca.SX.sym("x", 2)
    fields = {
        "variables": x,
        "objective": (1 - x[0]) ** 2 + 100 * (x[1] - x[0] ** 2) ** 2,
        "constraints": x[0] ** 2 + x[1] ** 2,
        "lower": -inf,
        "upper": 1.0,
    }
    return NonlinearProgram(**{**fields, **changes})


@pytest.mark.parametrize("exact_hessian", [True, False])
def test_no_feasible_point_nearby_is_cheaper(exact_hessian):
    program = _program()
    result = solve_nonlinear(program, [-0.5, 0.5], exact_hessian=exact_hessian)
    assert result.converged
    assert result.status == "solved to the tolerance"
    rng = np.random.default_rng(0)
    near = result.x + 1e-3 * rng.standard_normal((1000, 2))
    inside = near[(near**2).sum(axis=1) <= 1.0]
    assert min(program.cost(x) for x in inside) > result.cost
    assert abs(np.hypot(*result.x) - 1.0) < 1e-7


def test_cost_and_violation_are_those_of_the_program():
    program = _program(x_min=np.array([-1.0, 0.7]))
    result = solve_nonlinear(program, [0.0, 0.9])
    x, y = result.x
    assert result.cost == pytest.approx((1 - x) ** 2 + 100 * (y - x**2) ** 2, abs=1e-12)
    assert result.violation == pytest.approx(max(0.0, x**2 + y**2 - 1.0, 0.7 - y), abs=1e-15)
    assert program.violation(np.array([3.0, 0.0])) == pytest.approx(8.0)
    assert program.violation(np.array([np.nan, 0.0])) == inf


def test_a_start_at_the_optimum_is_kept_with_a_small_barrier():
    program = _program()
    best = solve_nonlinear(program, [-0.5, 0.5])
    again = solve_nonlinear(program, best.x, initial_barrier=1e-8)
    assert again.converged
    assert again.iterations < best.iterations
    np.testing.assert_allclose(again.x, best.x, atol=1e-6)


def test_no_point_that_violates_is_called_converged():
    impossible = _program(upper=-1.0)
    result = solve_nonlinear(impossible, [0.1, 0.1])
    assert not result.converged
    assert result.violation >= 1.0
    assert "violation" in result.status


def test_running_out_of_iterations_is_said():
    result = solve_nonlinear(_program(), [-0.5, 0.5], max_iterations=2)
    assert not result.converged
    assert result.status == "stopped at the limit of iterations"


def test_running_out_of_time_is_said():
    result = solve_nonlinear(_program(), [-0.5, 0.5], time_limit=1e-9)
    assert not result.converged
    assert result.status == "stopped at the limit of time"


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"lower": 2.0}, "lower must not exceed upper; entry 0 does"),
        ({"x_max": np.array([1.0, -inf]), "x_min": 0.0}, "x_min must not exceed x_max; entry 1 does"),
        ({"x_min": np.zeros(3)}, "x_min must be one number or 2"),
    ],
)
def test_bounds_that_cannot_hold_are_refused(changes, sentence):
    with pytest.raises(SpecError, match=sentence):
        _program(**changes)


def test_a_start_of_the_wrong_size_is_refused():
    with pytest.raises(SpecError, match="start must have the shape"):
        solve_nonlinear(_program(), [0.0, 0.0, 0.0])


def test_without_casadi_the_remedy_is_the_command_that_installs_it(monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(
        "aerobat.optimization.nonlinear.find_spec", lambda name: None if name == "casadi" else find(name)
    )
    with pytest.raises(BackendMissing, match=r'pip install "aerobat\[casadi\]"'):
        import_casadi()
