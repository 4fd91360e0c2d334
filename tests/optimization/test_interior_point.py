"""The interior point method: SciPy's answers, and the laws of a minimum."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import linprog, minimize

from aerobat.optimization.bordered_band import BorderedBand
from aerobat.optimization.deadline import within_time
from aerobat.optimization.interior_point import Settings, interior_point
from bordered_bands import bordered_band

Array = NDArray[np.float64]
ACCURATE = Settings(barrier=1e-3, least_barrier=1e-9, tolerance=1e-8, gain=0.0, iterations=200)


@dataclass
class DenseRows:
    """Slopes as one matrix."""

    matrix: Array

    def times(self, step: Array) -> Array:
        return np.asarray(self.matrix @ step)

    def transposed(self, weights: Array) -> Array:
        return np.asarray(self.matrix.T @ weights)


@dataclass
class Quadratics:
    """gᵀ x subject to xᵀ P_i x / 2 + a_i x <= b_i and E x = f, in a box."""

    cost: Array
    squares: Array  # (q, n, n)
    slopes: Array  # (q, n)
    bounds: Array  # (q,)
    equal: Array  # (p, n)
    target: Array  # (p,)
    reach: float = 10.0

    @property
    def box(self) -> tuple[Array, Array]:
        return np.full(len(self.cost), -self.reach), np.full(len(self.cost), self.reach)

    def at(self, x: Array) -> QuadraticsPoint:
        return QuadraticsPoint(self, x)


@dataclass
class QuadraticsPoint:
    """Constraints at a point."""

    program: Quadratics
    x: Array

    @property
    def inequalities(self) -> Array:
        p = self.program
        return np.asarray(0.5 * self.x @ p.squares @ self.x + p.slopes @ self.x - p.bounds)

    @property
    def equalities(self) -> Array:
        return np.asarray(self.program.equal @ self.x - self.program.target)

    @property
    def rows(self) -> DenseRows:
        return DenseRows(self.program.squares @ self.x + self.program.slopes)

    @property
    def equality_rows(self) -> Array:
        return self.program.equal

    def curvature(self, weights: Array, equality_weights: Array, squares: Array) -> BorderedBand:
        del equality_weights
        return bordered_band(np.tensordot(weights, self.program.squares, 1)).plus_squares(
            self.rows.matrix, squares
        )


def drawn(seed: int, convex: bool) -> Quadratics:
    """A program with a feasible point, its quadratics convex or not."""
    rng = np.random.default_rng(seed)
    n, q, p = int(rng.integers(3, 9)), int(rng.integers(2, 12)), int(rng.integers(0, 3))
    factors = rng.normal(size=(q, n, n))
    squares = factors @ factors.swapaxes(1, 2) if convex else factors + factors.swapaxes(1, 2)
    slopes, inside = rng.normal(size=(q, n)), rng.normal(size=n)
    bounds = 0.5 * inside @ squares @ inside + slopes @ inside + rng.uniform(0.1, 2.0, q)
    equal = rng.normal(size=(p, n))
    return Quadratics(rng.normal(size=n), squares, slopes, bounds, equal, equal @ inside)


@given(seed=st.integers(0, 2**31))
def test_a_convex_program_is_solved_as_scipy_solves_it(seed: int) -> None:
    program = drawn(seed, convex=True)
    found = interior_point(program, np.zeros(len(program.cost)), ACCURATE)
    point = program.at(found.x)
    assert found.converged
    assert point.inequalities.max() < 1e-6
    peer = minimize(
        lambda x: program.cost @ x,
        found.x,
        jac=lambda x: program.cost,
        method="SLSQP",
        bounds=list(zip(*program.box, strict=True)),
        constraints=[
            {"type": "ineq", "fun": lambda x: -program.at(x).inequalities},
            *([{"type": "eq", "fun": lambda x: program.at(x).equalities}] if len(program.target) else []),
        ],
        options={"ftol": 1e-12},
    )
    assert program.cost @ found.x <= peer.fun + 1e-5 * (1.0 + abs(peer.fun))


@given(seed=st.integers(0, 2**31))
def test_a_program_that_is_not_convex_ends_at_a_point_that_no_direction_improves(seed: int) -> None:
    """First-order conditions at the end, checked by the linear program of the slopes there."""
    program = drawn(seed, convex=False)
    found = interior_point(program, np.zeros(len(program.cost)), ACCURATE)
    if not found.converged:
        return  # a local method may end where violations have a minimum
    point = program.at(found.x)
    assert point.inequalities.max() < 1e-6
    lower, upper = program.box
    near = 1e-3
    step = linprog(
        program.cost,
        A_ub=point.rows.matrix,
        b_ub=np.maximum(-point.inequalities, 0.0),
        A_eq=program.equal if len(program.equal) else None,
        b_eq=np.zeros(len(program.equal)) if len(program.equal) else None,
        bounds=list(zip(np.maximum(lower - found.x, -near), np.minimum(upper - found.x, near), strict=True)),
    )
    assert step.fun > -1e-2 * near * np.abs(program.cost).sum()


@pytest.mark.slow
def test_most_programs_that_are_not_convex_are_solved() -> None:
    ends = [
        interior_point(program, np.zeros(len(program.cost)), ACCURATE)
        for program in (drawn(seed, convex=False) for seed in range(40))
    ]
    assert sum(end.converged for end in ends) >= 30


def test_the_curved_valley_is_followed_to_its_end() -> None:
    """min x subject to y = x² between two parabolas that leave a strip of a thousandth."""
    strip, bend = 1e-3, np.zeros((2, 2, 2))
    bend[0, 0, 0], bend[1, 0, 0] = 2.0, -2.0
    slopes = np.array([[0.0, -1.0], [0.0, 1.0]])
    program = Quadratics(
        np.array([-1.0, 0.0]), bend, slopes, np.array([strip, strip]), np.zeros((0, 2)), np.zeros(0), 2.0
    )
    found = interior_point(program, np.array([-1.2, 1.44]), ACCURATE)
    assert found.converged
    np.testing.assert_allclose(found.x[0], np.sqrt(2.0 + strip), atol=1e-3)


def test_no_time_leaves_the_start() -> None:
    program = drawn(1, convex=True)
    with within_time(0.0):
        found = interior_point(program, np.zeros(len(program.cost)), ACCURATE)
    assert not found.converged
    assert found.iterations == 0


@given(seed=st.integers(0, 2**31))
def test_known_multipliers_lead_to_the_same_minimum_sooner(seed: int) -> None:
    program = drawn(seed, convex=True)
    found = interior_point(program, np.zeros(len(program.cost)), ACCURATE)
    near = replace(ACCURATE, barrier=1e-8)
    again = interior_point(program, found.x, near, found.z)
    assert again.converged
    assert abs(program.cost @ (again.x - found.x)) < 1e-5 * (1.0 + abs(program.cost @ found.x))
    assert again.iterations <= found.iterations
