"""The one refinement: its derivatives, what its paths meet, and that they are fast."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat.environment import Box, Cylinder, Environment
from aerobat.planning import Miqp
from aerobat.planning.gate_clearance import bodies_in_gates
from aerobat.planning.polynomial.closed_forms import flying_lap, start_along_normals
from aerobat.planning.recorder import Recorder
from aerobat.planning.refinement.limit_values import LimitValues
from aerobat.planning.refinement.program import Multipliers, RefinementProgram
from aerobat.planning.refinement.refine import (
    MIN_GAP,
    MIN_SPACING,
    REPAIRABLE_MISS,
    Refinement,
    _between,
    knots_at_stages,
    with_exact_stages,
)
from aerobat.planning.refinement.spline import Spline, basis, chebyshev
from aerobat.planning.refinement.stage_values import StageValues
from aerobat.planning.task import Task
from aerobat.planning.warm_start import WarmStart
from aerobat.problem import Limits, Problem, load_problem
from aerobat.problem.ball import Ball
from aerobat.problem.stage import Stage
from aerobat.vehicle import Vehicle, load_vehicle
from bordered_bands import dense
from places import CASES
from random_flights import with_lags
from shared_plans import shared_plan

QUAD = load_vehicle("agile-quad")
COURSE = load_problem(str(CASES / "frame-course.toml"))


def program(problem: Problem, vehicle: Vehicle, segments: int) -> RefinementProgram:
    """Near a course's closed form, one of its stages a ball and in a window, its gates with room."""
    task = Task.of(problem, vehicle)
    guess = knots_at_stages(start_along_normals(task, 4), segments)
    ball = Stage("ball", ball=Ball(np.array([1.0, 2.0, 0.5]), 0.7), at=(0.1, 0.6))
    stages = (*guess.stages[:-1], ball)
    limits, trajectory = LimitValues(task), guess.trajectory
    return RefinementProgram(
        spline=Spline(task, trajectory),
        limits=limits,
        stages=StageValues(stages, task, bodies_in_gates(task)[:-1]),
        stage_segments=tuple(int(np.argmin(np.abs(trajectory.knots[1:] - time))) for time in guess.times),
        fractions=np.sort(np.random.default_rng(1).uniform(size=(trajectory.segments, 5))),
        backoff=np.full((trajectory.segments, len(limits.sides)), 1e-3),
        radius=1.0,
        stretch=1.5,
    )


MOVING = replace(
    COURSE,
    limits=Limits(velocity=9.0, acceleration=30.0),
    start=replace(COURSE.start, velocity=np.array([1.0, 0.5, 0.2])),
    goal=replace(COURSE.goal, free_velocity=True),
)

WALLED = replace(
    COURSE,
    environment=Environment(
        obstacles=(
            Cylinder(
                start=COURSE.gates[0].position + np.array([0.5, 0.8, -1.0]), end=(0.5, 0.8, 4), radius=0.2
            ),
            Box(position=COURSE.gates[-1].position + np.array([0.7, 0.0, 0.3]), size=(0.3, 0.4, 0.5)),
        )
    ),
)


@pytest.mark.parametrize("problem", [COURSE, MOVING, WALLED], ids=["rest", "moving", "walled"])
@pytest.mark.parametrize("lag", [0.0, 0.02])
def test_slopes_and_second_derivatives_are_differences(problem: Problem, lag: float) -> None:
    dragged = replace(with_lags(QUAD, lag), drag_body=np.array([0.2, 0.2, 0.1]))
    near = program(problem, dragged, 6)
    rng = np.random.default_rng(0)
    x = near.spline.start + 1e-3 * rng.normal(size=near.spline.size)
    step, change = rng.normal(size=len(x)), 1e-6
    here, ahead, behind = (near.at(x + h * step) for h in (0.0, change, -change))
    moved = (ahead.inequalities - behind.inequalities) / (2.0 * change)
    expected = here.rows.times(step)
    np.testing.assert_allclose(moved, expected, atol=1e-6 * np.abs(expected).max())
    equal = (ahead.equalities - behind.equalities) / (2.0 * change)
    np.testing.assert_allclose(equal, here.equality_rows @ step, atol=1e-6)
    weights, others = rng.uniform(size=len(moved)), rng.normal(size=len(equal))
    gradients = [at.rows.transposed(weights) + at.equality_rows.T @ others for at in (ahead, behind)]
    change_of_gradient = (gradients[0] - gradients[1]) / (2.0 * change)
    expected = dense(here.curvature(weights, others, 0.0 * weights)) @ step
    np.testing.assert_allclose(change_of_gradient, expected, atol=1e-5 * np.abs(expected).max())
    squared = dense(here.curvature(0.0 * weights, 0.0 * others, weights)) @ step
    expected = here.rows.transposed(weights * here.rows.times(step))
    np.testing.assert_allclose(squared, expected, rtol=1e-8, atol=1e-10 * np.abs(expected).max())


@given(st.floats(0.0, 1.0), st.integers(1, 60))
def test_places_added_at_one_peak_stay_apart(peak: float, count: int) -> None:
    """Twenty places in one gap, each in a quarter of what the last one left, were 1e-14 s apart."""
    places = chebyshev(16)
    for _ in range(count):
        added = _between(places, peak)
        assert np.abs(places - added).min() >= MIN_SPACING * MIN_GAP
        places = np.sort(np.append(places, added))


@given(seed=st.integers(0, 2**32 - 1))
def test_after_a_solve_stages_are_met_exactly_and_the_path_hardly_moves(seed: int) -> None:
    """Solves end with conditions of stages missed by rounding of their size, which refused good paths."""
    near, rng = program(COURSE, QUAD, 6), np.random.default_rng(seed)
    solved = with_exact_stages(near, near.spline.start)
    missing = solved + 1e-3 * rng.normal(size=near.spline.size)
    before, _ = near.at(missing).missed(REPAIRABLE_MISS)
    met = with_exact_stages(near, missing)
    after, _ = near.at(met).missed(REPAIRABLE_MISS)
    assert np.abs(after).max() < 1e-9 < np.abs(before).max()
    assert np.linalg.norm(met - missing) <= 1.01 * np.linalg.norm(solved - missing)


@pytest.mark.parametrize("closed", [False, True], ids=["open", "closed"])
def test_squares_of_all_rows_but_a_whole_laps_lie_in_the_band_and_the_border(closed: bool) -> None:
    """The attitude in which a lap ends depends on all of it; laps were slow when that square went astray."""
    near = program(COURSE, QUAD, 6)
    if closed:
        task = Task.of(load_problem("lap-7"), QUAD)
        lap, stages = knots_at_stages(flying_lap(task, 4), 8), StageValues(task.stages.stages, task, ())
        near = replace(
            near,
            spline=Spline(task, lap.trajectory),
            limits=LimitValues(task),
            stages=stages,
            stage_segments=tuple(range(7)),
            fractions=np.tile(near.fractions[0], (8, 1)),
            backoff=np.zeros((8, len(LimitValues(task).sides))),
        )
    here = near.at(near.spline.start)
    equal, others = here.equality_rows, here.rows.others
    weights, values = np.ones(len(here.inequalities)), here.equalities
    matrix = here.curvature(weights, values, 0.0 * weights)
    fits = matrix.pattern.has_squares(equal)
    assert len(fits) - fits.sum() == closed
    assert matrix.pattern.has_squares(others).all()
    for rows in (equal[fits], others):
        found = dense(matrix.plus_squares(rows, 2.0))
        expected = dense(matrix) + 2.0 * rows.T @ rows
        np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


def test_variables_of_a_path_give_the_path_and_others_meet_its_ends() -> None:
    near = program(MOVING, QUAD, 6)
    spline = near.spline
    initial = spline.trajectory(spline.start)
    again = replace(spline, initial=initial)
    times = np.linspace(0.0, initial.duration, 50)
    np.testing.assert_allclose(
        again.trajectory(again.start).evaluate(times), initial.evaluate(times), atol=1e-9
    )
    moved = spline.trajectory(spline.start + 0.1 * np.random.default_rng(1).normal(size=spline.size))
    for time, state in ((0.0, MOVING.start), (moved.duration, MOVING.goal)):
        for order in state.asked:
            reached = moved.evaluate(time, int(order))
            np.testing.assert_allclose(reached, state.derivatives(3)[order], atol=1e-7)
    for order in range(5):
        assert moved.jumps(order).max() <= 1e-6 * np.abs(moved.component_range(order)).max()


@given(seed=st.integers(0, 2**32 - 1))
def test_a_program_with_other_places_takes_all_multipliers_over(seed: int) -> None:
    """Each place's are shared by those beside it; those of the same place stay as they are."""
    near = program(COURSE, QUAD, 6)
    rng, kinds = np.random.default_rng(seed), near.enforced.shape[-1]
    peaks = rng.uniform(size=(len(near.fractions), 1))
    ends = np.broadcast_to([0.0, 1.0], (len(near.fractions), 2))
    others = replace(near, fractions=np.sort(np.hstack([near.fractions, peaks, ends]), axis=1))
    known = Multipliers(rng.uniform(size=near.enforced.size + 3), near.fractions)
    np.testing.assert_array_equal(near.at_its_places(known), known.values)
    found = others.at_its_places(known)
    at_places = found[: others.enforced.size].reshape(len(near.fractions), -1, kinds)
    expected = known.values[: near.enforced.size].reshape(len(near.fractions), -1, kinds)
    np.testing.assert_allclose(at_places.sum(axis=1), expected.sum(axis=1))
    np.testing.assert_array_equal(found[others.enforced.size :], known.values[near.enforced.size :])


@given(fraction=st.floats(0.0, 1.0), segment=st.integers(0, 5), order=st.integers(0, 5))
def test_the_basis_is_the_polynomials_own(fraction: float, segment: int, order: int) -> None:
    spline = program(COURSE, QUAD, 6).spline
    found = spline.data(spline.start).derivatives(basis(np.array([fraction])))[segment, 0, order]
    expected = spline.trajectory(spline.start).on_segments([fraction], order)[segment, 0]
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max() + 1e-9)


@pytest.mark.parametrize(
    ("name", "best"),
    [pytest.param("line", 1.457, marks=pytest.mark.slow), ("half-flip", 2.080), ("flip-roll", 1.842)],
)
def test_a_maneuver_is_refined_to_within_a_hundredth_and_a_half_of_the_best_known(
    name: str, best: float
) -> None:
    """The best known are polynomials of 8 segments found by IPOPT with free knots; no reserve."""
    start = shared_plan(name)
    refinement = replace(Refinement.of(Task.of(start.problem, QUAD), Recorder(None)), in_gates=())
    found = refinement.refined(WarmStart.of(start, refinement.task.stages), 8)
    assert found.feasible
    assert found.solution.duration < 1.015 * best


@pytest.mark.slow
def test_a_path_that_begins_and_ends_at_a_limit_is_refined() -> None:
    """On the ground, where its height may not be backed off from."""
    line = load_problem("line")
    grounded = replace(line, limits=replace(line.limits, lower=(-np.inf, -np.inf, 0.0)))
    assert grounded.start.position[2] == 0.0
    found = Miqp().plan(grounded, QUAD)
    assert found.certified
    assert found.duration < 1.02 * 1.457


@pytest.mark.slow
def test_a_path_that_holds_at_its_places_but_swings_far_between_them_is_repaired() -> None:
    """Rotors that lag by 55 ms: their commands swing by 1.2 times their range between the first places."""
    problem, quad = load_problem(str(CASES / "two-gates.toml")), load_vehicle(str(CASES / "late-quad.toml"))
    refinement = Refinement.of(replace(Task.of(problem, quad), reserve=0.15), Recorder(None))
    rough = refinement.rough(start_along_normals(refinement.task, 4).time_scaled(1.5), 8)
    assert refinement.is_promising(rough)
    assert rough.violation.largest < 0.1
