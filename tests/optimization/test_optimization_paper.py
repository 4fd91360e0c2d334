"""The paper's programs: the known optima, and other engines' answers on programs like them."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from aerobat.optimization import AssignmentProgram, solver
from paper_program import FLIP_PITCH, FLIP_ROLL, FLIP_TRANSLATION, HALF_FLIP, Maneuver, flip, half_flip

# sums of squared jerks for N = 20 on which three exact solvers agreed to ten digits
FLIPS = [(FLIP_ROLL, 273196.1243), (FLIP_PITCH, 273196.1243), (FLIP_TRANSLATION, 280399.0114)]
SECOND_DT = float(np.linspace(0.1, 4.0, 50)[1])  # of the paper's grid


@pytest.mark.parametrize(("maneuver", "cost"), FLIPS)
@pytest.mark.parametrize("backend", ["builtin", "gurobi"])
def test_flips_have_the_known_optimum(maneuver: Maneuver, cost: float, backend: str) -> None:
    result = solver(backend).solve(flip(maneuver))
    assert result.status == "optimal"
    assert result.cost == pytest.approx(cost, rel=1e-9)
    assert result.bound == pytest.approx(cost, rel=1e-8)
    assert result.max_violation < 1e-9


@pytest.mark.parametrize("maneuver", [FLIP_ROLL, FLIP_PITCH, FLIP_TRANSLATION])
@pytest.mark.parametrize(
    ("intervals", "max_nodes"), [(20, 8), (40, 8), (80, 30), pytest.param(160, 60, marks=pytest.mark.slow)]
)
def test_a_flip_is_proven_optimal_with_few_relaxations(
    maneuver: Maneuver, intervals: int, max_nodes: int
) -> None:
    result = solver().solve(flip(maneuver, intervals, dt=2.0 / intervals))
    assert result.status == "optimal"
    assert result.nodes <= max_nodes


@pytest.mark.parametrize("backend", ["builtin", "gurobi", "scip"])
def test_the_half_flip_is_infeasible_at_the_first_dt_and_has_the_known_optimum_at_the_second(
    backend: str,
) -> None:
    assert solver(backend).solve(half_flip(HALF_FLIP, dt=0.1)).status == "infeasible"
    result = solver(backend).solve(half_flip(HALF_FLIP, dt=SECOND_DT))
    assert (result.status, result.slots) == ("optimal", (10,))
    assert result.cost == pytest.approx(14713.1747, rel=1e-6 if backend == "scip" else 1e-8)


def test_scip_agrees_on_a_short_flip() -> None:
    program = flip(FLIP_ROLL, intervals=7, dt=0.45)
    result, ours = solver("scip").solve(program), solver().solve(program)
    assert (result.status, ours.status) == ("optimal", "optimal")
    assert result.cost == pytest.approx(ours.cost, rel=1e-6)


def random_program(seed: int) -> AssignmentProgram:
    """Limits, gate, end, thrusts, N, dt and the order at random; about a third have no solution."""
    rng = np.random.default_rng(seed)
    maneuver = Maneuver(
        gate=tuple(rng.uniform([-2, -2, 1], [2, 2, 6])),
        end=tuple(rng.uniform(-2, 2, 3)),
        lateral=int(rng.integers(2)),
        lateral_thrust=rng.uniform(2, 25),
        inverted_thrust=rng.uniform(2, 30),
        max_velocity=rng.uniform(6, 14),
        max_acceleration=rng.uniform(30, 90),
        max_jerk=rng.uniform(100, 500),
        ordered=bool(rng.integers(2)),
    )
    return flip(maneuver, int(rng.integers(8, 13)), rng.uniform(0.12, 0.35))


@cache
def answers(seed: int) -> tuple[tuple[str, float], tuple[str, float]]:
    program = random_program(seed)
    ours, theirs = solver().solve(program), solver("gurobi").solve(program)
    return (ours.status, ours.cost), (theirs.status, theirs.cost)


SEEDS = range(25)
MORE = range(25, 75)


@pytest.mark.parametrize("seed", [*SEEDS, *(pytest.param(seed, marks=pytest.mark.peer) for seed in MORE)])
def test_gurobi_agrees_on_random_flips(seed: int) -> None:
    (status, cost), (their_status, their_cost) = answers(seed)
    assert status == their_status
    assert cost == pytest.approx(their_cost, rel=1e-6)


def test_random_flips_are_of_both_kinds() -> None:
    statuses = [answers(seed)[0][0] for seed in SEEDS]
    assert 5 <= statuses.count("infeasible") <= 20
    assert statuses.count("optimal") + statuses.count("infeasible") == len(SEEDS)
