"""Partially separable programs: the values, derivatives and optima of the same program written out."""

from math import inf

import numpy as np
import pytest

from aerobat.optimization.nonlinear import NonlinearProgram, import_casadi, solve_nonlinear
from aerobat.optimization.separable import Element, ElementFunction, SeparableFunction, separable_program

pytest.importorskip("casadi")

SIZE = 9
LINKS = np.stack([np.arange(SIZE - 1), np.arange(1, SIZE)], axis=1)  # each unknown with the next


def valley() -> ElementFunction:
    """Rosenbrock's, with its stiffness as the parameter."""
    ca = import_casadi()
    z, stiffness = ca.SX.sym("z", 2), ca.SX.sym("stiffness")
    value = (1 - z[0]) ** 2 + stiffness * (z[1] - z[0] ** 2) ** 2
    return ElementFunction(ca.Function("valley", [z, stiffness], [value]))


def pair() -> ElementFunction:
    """A product, and a sum of cubes."""
    ca = import_casadi()
    z, none = ca.SX.sym("z", 2), ca.SX.sym("none", 0)
    return ElementFunction(ca.Function("pair", [z, none], [ca.vertcat(z[0] * z[1], z[0] ** 3 + z[1] ** 3)]))


def parts() -> tuple[SeparableFunction, SeparableFunction]:
    """A cost, and constraints of which two links' values add up to each row but the first and the last."""
    links = len(LINKS)
    costs = Element(
        valley(), LINKS, np.linspace(50.0, 100.0, links)[:, None], np.zeros((links, 1), dtype=int)
    )
    rows = np.stack([np.arange(links), np.arange(1, links + 1)], axis=1)
    sums = Element(pair(), LINKS, np.zeros((links, 0)), rows)
    return SeparableFunction([costs], SIZE, 1), SeparableFunction([sums], SIZE, links + 1)


def written_out() -> NonlinearProgram:
    """The same, in one expression each."""
    ca, links = import_casadi(), len(LINKS)
    x, stiffness = ca.SX.sym("x", SIZE), np.linspace(50.0, 100.0, len(LINKS))
    cost = sum((1 - x[i]) ** 2 + stiffness[i] * (x[i + 1] - x[i] ** 2) ** 2 for i in range(links))
    rows = [0] * (links + 1)
    for i in range(links):
        rows[i] += x[i] * x[i + 1]
        rows[i + 1] += x[i] ** 3 + x[i + 1] ** 3
    return NonlinearProgram(x, cost, ca.vertcat(*rows), np.array(-inf), np.array(1.0))


def test_derivatives_are_those_of_the_program_written_out():
    ca, rng = import_casadi(), np.random.default_rng(0)
    plain = written_out()
    separable = separable_program(*parts(), lower=np.array(-inf), upper=np.array(1.0))
    x, weight = rng.normal(size=SIZE), 0.7
    multipliers = rng.normal(size=SIZE)
    f, g = (float(separable.values(x)[0]), separable.values(x)[1].full()[:, 0])
    assert f == pytest.approx(plain.cost(x), rel=1e-12)
    assert g == pytest.approx(plain.values(x)[1].full()[:, 0], rel=1e-12)
    lagrangian = weight * plain.objective + ca.dot(ca.DM(multipliers), plain.constraints)
    expected = {
        "grad_f": ca.gradient(plain.objective, plain.variables),
        "jac_g": ca.jacobian(plain.constraints, plain.variables),
        "hess_lag": ca.triu(ca.hessian(lagrangian, plain.variables)[0]),
    }
    for name, expression in expected.items():
        function = separable.derivatives[name]
        arguments = (x, []) if name != "hess_lag" else (x, [], weight, multipliers)
        found = function(*arguments)
        found = found if name == "hess_lag" else found[1]
        known = ca.Function(name, [plain.variables], [expression])(x)
        assert ca.DM(found).full() == pytest.approx(known.full(), rel=1e-10, abs=1e-10)


def test_the_optimum_is_that_of_the_program_written_out():
    separable = separable_program(*parts(), lower=np.array(-inf), upper=np.array(1.0))
    start = np.full(SIZE, 0.3)
    found, known = (solve_nonlinear(program, start) for program in (separable, written_out()))
    assert found.converged
    assert found.iterations == known.iterations
    assert found.x == pytest.approx(known.x, abs=1e-7)
    assert found.cost == pytest.approx(known.cost, rel=1e-9)


def test_what_is_known_of_a_neighbour_saves_iterations():
    separable = separable_program(*parts(), lower=np.array(-inf), upper=np.array(1.0))
    tighter = separable_program(*parts(), lower=np.array(-inf), upper=np.array(0.999))
    first = solve_nonlinear(separable, np.full(SIZE, 0.3))
    cold = solve_nonlinear(tighter, first.x)
    warm = solve_nonlinear(tighter, first.x, initial_barrier=1e-6, multipliers=first.multipliers)
    assert warm.converged
    assert warm.iterations < cold.iterations
    assert warm.cost == pytest.approx(cold.cost, rel=1e-6)
