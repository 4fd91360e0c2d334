"""Paper mode reproduces the authors' formulation: known optima, the grid on dt, bounds where they bind."""

from dataclasses import replace

import numpy as np
import pytest

from aerobat.planning import GridSearch, Miqp, Plan, plan
from aerobat.problem import Limits, load_problem

AT_100_MS = {"flip-roll": 273196.1243, "flip-pitch": 273196.1243, "flip-roll-translation": 280399.0114}
HALF_FLIP = 14713.1747


def in_paper(name: str, backend: str = "builtin") -> Plan:
    return plan(load_problem(name).as_in_paper(), Miqp(order=3, backend=backend), vehicle=None)


@pytest.mark.parametrize("name", AT_100_MS)
@pytest.mark.parametrize("backend", ["builtin", "gurobi"])
def test_flips_cost_what_three_exact_solvers_found_at_a_tenth_of_a_second(name: str, backend: str) -> None:
    found = in_paper(name, backend)
    assert found.dt == 0.1
    assert found.cost == pytest.approx(AT_100_MS[name], rel=1e-6 if backend == "gurobi" else 1e-9)


@pytest.mark.parametrize("backend", ["builtin", "gurobi", "scip"])
def test_the_half_flip_is_infeasible_at_the_grids_first_step_and_known_at_its_second(backend: str) -> None:
    found = in_paper("half-flip", backend)
    assert [a.feasible for a in found.attempts] == [False, True]
    assert found.dt == pytest.approx(0.179592, abs=1e-6)
    assert found.cost == pytest.approx(HALF_FLIP, rel=1e-6)


@pytest.mark.parametrize("name", ["flip-roll", "flip-roll-translation", "half-flip", "line"])
def test_a_plan_meets_its_ends_and_the_papers_bounds(name: str) -> None:
    found = in_paper(name)
    problem, trajectory = found.problem, found.trajectory
    last = trajectory.duration
    for derivative in range(3):
        ends = trajectory.evaluate(np.array([0.0, last]), derivative)
        wanted = [e.derivatives(3)[derivative] for e in (problem.start, problem.goal)]
        np.testing.assert_allclose(ends, wanted, atol=1e-6)
    inner = trajectory.knots[1:-1]
    for derivative, bound in ((1, 10.0), (2, 90.0)):
        assert np.abs(trajectory.evaluate(inner, derivative)).max() <= bound * (1 + 1e-5)
    jerk = trajectory.on_segments(np.array([0.5]), 3)[:, 0]
    assert np.abs(jerk).max() <= 200.0 * (1 + 1e-5)
    assert found.cost == pytest.approx(float(np.sum(jerk**2)), rel=1e-9)


@pytest.mark.parametrize("name", ["flip-roll", "flip-pitch", "flip-roll-translation", "half-flip"])
def test_every_stage_holds_where_the_plan_says(name: str) -> None:
    found = in_paper(name)
    course = found.problem.stages(50.0)
    g = np.array([0.0, 0.0, 9.81])
    for stage, placed in zip(course.stages, found.stages, strict=True):
        assert placed.time == pytest.approx((placed.interval + 1) * found.dt)
        for condition in stage.conditions:
            value = found.trajectory.evaluate(placed.time, condition.quantity.derivative)
            if condition.quantity == "specific_thrust":
                value = value + g
            reached = condition.direction @ value
            assert condition.lower - 1e-4 <= reached <= condition.upper + 1e-4


def test_the_first_feasible_of_another_grid_is_taken() -> None:
    problem = load_problem("flip-roll").as_in_paper()
    found = plan(problem, Miqp(order=3, search=GridSearch(0.05, 0.2, 16)), vehicle=None)
    assert [a.feasible for a in found.attempts][:-1] == [False] * (len(found.attempts) - 1)
    assert found.attempts[-1].feasible


@pytest.mark.parametrize("order", [3, 4, 5])
@pytest.mark.parametrize("intervals", [8, 15, 20])
def test_the_papers_gate_is_passed_at_the_end_of_interval_n_over_2(order: int, intervals: int) -> None:
    problem = replace(load_problem("half-flip").as_in_paper(), limits=Limits(velocity=10.0))
    found = plan(problem, Miqp(order=order, intervals=intervals), vehicle=None)
    passed = found.trajectory.evaluate((intervals // 2 + 1) * found.dt)
    np.testing.assert_allclose(passed, problem.gates[0].position, atol=1e-5)
