"""Two flips through two gates, crossing times free: eight ordered stages, proven optimal, and cheaply."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import aerobat as ab
from aerobat import so3
from aerobat.optimization import AssignmentProgram, solver
from aerobat.planning.miqp.miqp import formulate
from aerobat.planning.task import Task
from aerobat.problem import CustomManeuver, Flip, Problem, at_rest, load_problem
from aerobat.problem.condition import Condition, Quantity
from aerobat.trajectory import Trajectory
from places import ROOT

EXAMPLE = ROOT / "examples" / "two-flips.toml"
DURATION = 4.0  # [s]
COST = 56720.5713  # sum of squared jerks for N = 40


@cache
def two_flips(intervals: int, duration: float = DURATION) -> AssignmentProgram:
    return formulate(Task.of(in_the_plane(load_problem(EXAMPLE))), 3, intervals).program(duration / intervals)


def in_the_plane(problem: Problem) -> Problem:
    """The problem whose gates ask their attitude in the plane of the turn, as the known optimum has it."""
    upside_down = (
        Condition(Quantity.SPECIFIC_THRUST, (0.0, 1.0, 0.0), 0.0, 0.0),
        Condition(Quantity.SPECIFIC_THRUST, (0.0, 0.0, 1.0), upper=-7.0),
    )
    assert isinstance(problem.maneuver, CustomManeuver)
    stages = (
        s if s.gate is None else replace(s, min_upright_thrust=None, conditions=upside_down)
        for s in problem.maneuver.stages
    )
    return replace(problem, maneuver=replace(problem.maneuver, stages=tuple(stages)))


def test_forty_intervals_are_proven_optimal_with_a_few_hundred_relaxations() -> None:
    result = solver().solve(two_flips(40))
    assert result.status == "optimal"
    assert result.slots is not None
    assert list(result.slots) == sorted(set(result.slots))
    assert result.gap < 1e-9
    assert result.nodes < 500
    assert result.cost * (40 / DURATION) ** 6 == pytest.approx(COST, rel=1e-9)


def test_both_gates_are_met_upside_down_and_upright_flight_lies_between() -> None:
    formulation = formulate(Task.of(load_problem(EXAMPLE)), 3, 40)
    dt = DURATION / 40
    result = solver().solve(formulation.program(dt))
    assert result.x is not None
    assert result.slots is not None
    trajectory = Trajectory.from_inputs(formulation.initial, formulation.inputs(result.x, dt), dt)
    times = (np.array(result.slots) + 1) * dt
    positions, thrusts = trajectory.evaluate(times), trajectory.evaluate(times, 2)[:, 2] + 9.80665
    np.testing.assert_allclose(positions[[1, 5]], [[2.5, 0.0, 5.5], [7.5, 0.0, 5.5]], atol=1e-6)
    assert (thrusts[[1, 5]] < -6.9).all()
    assert (thrusts[[3, 7]] > 6.9).all()


@pytest.mark.parametrize(
    ("backend", "intervals"), [("gurobi", 16), pytest.param("scip", 12, marks=pytest.mark.peer)]
)
def test_other_solvers_agree_on_fewer_intervals(backend: str, intervals: int) -> None:
    program = two_flips(intervals)
    ours, theirs = solver().solve(program), solver(backend).solve(program)
    assert (ours.status, ours.slots) == ("optimal", theirs.slots)
    assert ours.cost == pytest.approx(theirs.cost, rel=1e-6)


def varied(seed: int) -> AssignmentProgram:
    """Other thrusts, limits, duration and order of integrator; some have no solution."""
    rng = np.random.default_rng(seed)
    example = load_problem(EXAMPLE)
    assert isinstance(example.maneuver, CustomManeuver)
    stages = tuple(
        replace(stage, conditions=tuple(stronger(c, factor) for c in stage.conditions))
        for stage, factor in zip(example.maneuver.stages, rng.uniform(0.5, 2.5, 8), strict=True)
    )
    limits = replace(example.limits, acceleration=rng.uniform(25, 60), velocity=rng.uniform(5, 12))
    problem = replace(example, maneuver=replace(example.maneuver, stages=stages), limits=limits)
    return formulate(Task.of(problem), int(rng.integers(3, 5)), 12).program(rng.uniform(0.2, 0.4))


def stronger(condition: Condition, factor: float) -> Condition:
    if condition.quantity is not Quantity.SPECIFIC_THRUST:
        return condition
    return replace(condition, lower=factor * condition.lower, upper=factor * condition.upper)


@pytest.mark.parametrize(
    "seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.peer) for seed in range(2, 8))]
)
def test_gurobi_agrees_on_variations(seed: int) -> None:
    ours, theirs = solver().solve(varied(seed)), solver("gurobi").solve(varied(seed))
    assert ours.status == theirs.status
    assert ours.cost == pytest.approx(theirs.cost, rel=1e-6)


def test_a_setup_shared_along_dt_gives_the_answers_of_a_fresh_one() -> None:
    formulation, kept = formulate(Task.of(load_problem(EXAMPLE)), 3, 20), solver()
    for duration in (4.0, 5.0, 1.0, 3.0, 4.0):
        program = formulation.program(duration / 20)
        together, alone = kept.solve(program), solver().solve(program)
        assert (together.status, together.slots, together.nodes) == (alone.status, alone.slots, alone.nodes)
        assert together.cost == alone.cost


@pytest.mark.parametrize("shift", [0, 1])
def test_a_start_changes_nothing_but_the_way(shift: int) -> None:
    program = two_flips(20)
    result = solver().solve(program)
    assert result.slots is not None
    started = solver().solve(program, start=[slot - shift for slot in result.slots])
    assert (started.status, started.slots) == ("optimal", result.slots)
    assert started.cost == pytest.approx(result.cost, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seconds"), [("agile-quad", 1.75), ("crazyflie", 3.2)])
def test_two_flips_in_a_row_turn_over_twice_and_leave_weak_rotors_no_detour(
    name: str, seconds: float
) -> None:
    """Closed forms know no attitudes: from those the Crazyflie took 7.8 s, 20 m across."""
    problem = Problem("along", at_rest((0.0, 0.0, 1.0)), at_rest((8.0, 0.0, 1.0)), Flip(count=2))
    plan = ab.plan(problem, ab.FreeKnots(reserve=0.15), name)
    assert plan.certified
    assert plan.duration < seconds
    assert plan.vehicle is not None
    inverted = np.array([stage.time for stage in plan.stages if stage.name in ("180°", "540°")])
    setpoint = ab.reference(plan.trajectory, plan.vehicle, inverted).setpoint
    assert (so3.axes(setpoint.q_world_body)[:, 2, 2] < np.cos(np.deg2rad(149.0))).all()
