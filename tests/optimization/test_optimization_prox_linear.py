"""The prox-linear method: it ends at local optima, from outside the constraints too."""

from dataclasses import dataclass

import numpy as np
import pytest

from aerobat.optimization.assignment import AssignmentProgram, SlottedStage
from aerobat.optimization.backends import solver
from aerobat.optimization.prox_linear import Linearization, prox_linear


class Disc:
    """A linear cost in the disc |x| ≤ 1 of the plane, with x₃ = x₁² as an equality."""

    def __init__(self, cost):
        self.cost = np.array(cost)
        self.scale = np.ones(3)
        self.reach = np.full(3, 0.5)
        self.bounded = (np.zeros((0, 3)), np.zeros(0), np.zeros(0))

    def at(self, x):
        return DiscPoint(np.array([x[0], x[1], x[0] ** 2]))


@dataclass(frozen=True, eq=False)
class DiscPoint:
    x: np.ndarray

    @property
    def violation(self):
        return float(self.x[0] ** 2 + self.x[1] ** 2 - 1.0)

    def linearization(self):
        row = np.array([[2 * self.x[0], 2 * self.x[1], 0.0]])
        equality = np.array([[-2 * self.x[0], 0.0, 1.0]])
        return Linearization(
            np.array([self.violation]), row, np.array([self.x[2] - self.x[0] ** 2]), equality
        )


@pytest.mark.parametrize("start", [(0.1, 0.2, 0.01), (3.0, -4.0, 9.0)])
def test_the_optimum_of_a_linear_cost_in_a_disc_is_on_its_edge(start):
    program = Disc([3.0, 4.0, 0.0])
    result = prox_linear(program, program.at(np.array(start)), 80)
    assert result.converged
    np.testing.assert_allclose(result.point.x[:2], [-0.6, -0.8], atol=0.02)
    assert result.point.violation < 1e-3


def test_without_a_cost_the_first_point_inside_will_do():
    program = Disc([0.0, 0.0, 0.0])
    inside = program.at(np.array([0.1, 0.2, 0.0]))
    assert prox_linear(program, inside).steps == 0
    result = prox_linear(program, program.at(np.array([3.0, 0.0, 0.0])))
    assert result.point.violation <= 1e-9


@pytest.mark.parametrize(("reach", "arrives"), [(0.5, True), (0.05, False)])
def test_a_search_without_a_cost_goes_on_only_where_violations_fall_quickly(reach, arrives):
    program = Disc([0.0, 0.0, 0.0])
    program.reach = np.full(3, reach)
    result = prox_linear(program, program.at(np.array([3.0, 0.0, 9.0])), 80)
    assert (result.point.violation <= 1e-9) == result.converged == arrives
    assert arrives or result.steps < 10


class Crescent(Disc):
    """The same with a bound beside the disc that no point of it meets."""

    def __init__(self):
        super().__init__([0.0, 0.0, 0.0])
        self.bounded = (np.array([[1.0, 0.0, 0.0]]), np.array([2.0]), np.array([np.inf]))


def test_a_search_gives_up_where_even_the_linearization_leaves_the_violation_and_mending_goes_on():
    program = Crescent()
    start = program.at(np.array([2.0, 0.1, 4.0]))
    search, mending = (prox_linear(program, start, 80, gives_up=gives_up) for gives_up in (True, False))
    assert not search.converged
    assert search.steps == 1
    assert mending.steps > 1
    disc = Disc([0.0, 0.0, 0.0])
    near = prox_linear(disc, disc.at(np.array([1.2, 0.1, 1.44])), 80, gives_up=True)
    assert near.converged
    assert near.point.violation <= 1e-9


def test_a_violation_that_is_tolerated_costs_no_further_steps():
    program = Disc([3.0, 4.0, 0.0])
    start = program.at(np.array([-0.601, -0.801, 0.0]))
    careful, lenient = (prox_linear(program, start, 80, tolerance) for tolerance in (0.0, 1e-2))
    assert lenient.point.violation <= 1e-2
    assert lenient.steps < careful.steps


@pytest.mark.parametrize(("third", "status"), [(2.0, "optimal"), (2.5, "infeasible")])
def test_equalities_that_depend_on_each_other_are_told_from_those_that_contradict(third, status):
    """Bounds that meet only when stages are placed: x + y = 2 once as a row of its own, once as a sum."""
    rows = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    stage = SlottedStage("all", (0, 1), [[0, 1, 2], [0, 1, 2]], [1.0, 1.0, third], [1.0, 1.0, third])
    program = AssignmentProgram(
        equality=np.zeros((0, 2)),
        target=np.zeros(0),
        rows=rows,
        lower=np.full(3, -np.inf),
        upper=np.full(3, np.inf),
        stages=(stage,),
    )
    assert solver("builtin").solve(program).status == status
