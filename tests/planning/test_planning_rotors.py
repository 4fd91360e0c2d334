"""With a vehicle, the plan is the fastest that its rotors can fly; what cannot be says which bound binds."""

from dataclasses import replace

import numpy as np
import pytest

from aerobat.environment import Environment
from aerobat.errors import Infeasible, SpecError
from aerobat.planning import BisectionSearch, Miqp, Plan, plan
from aerobat.problem import (
    Condition,
    CustomManeuver,
    EndState,
    Flip,
    HalfFlip,
    Limits,
    Problem,
    Stage,
    at_rest,
    load_problem,
    tilted_gate,
)
from aerobat.states import STANDARD_GRAVITY
from aerobat.vehicle import Vehicle, load_vehicle
from shared_plans import shared_plan

OTHERS = ("hexarotor", "crazyflie")
MANEUVERS = ["flip-roll", "flip-roll-translation", "flip-pitch", "half-flip", "line"]


@pytest.fixture(scope="module")
def quad() -> Vehicle:
    return load_vehicle("agile-quad")


@pytest.mark.parametrize(
    ("name", "vehicle"),
    [
        *((name, "agile-quad") for name in MANEUVERS),
        *(("line", vehicle) for vehicle in OTHERS),
        *(
            pytest.param(name, vehicle, marks=pytest.mark.slow)
            for name in ("half-flip", "flip-roll")
            for vehicle in OTHERS
        ),
    ],
)
def test_a_plan_keeps_every_rotor_within_its_limits(name: str, vehicle: str) -> None:
    craft = load_vehicle(vehicle)
    found = shared_plan(name, vehicle)
    assert found.certified
    assert found.order == 5
    assert found.margin.min_thrust >= craft.min_thrusts.min()
    assert found.margin.max_thrust <= craft.max_thrusts.max()


def test_rotors_without_lag_are_planned_with_snap_which_may_jump(quad: Vehicle) -> None:
    prompt = replace(quad, rotors=tuple(replace(r, lag=0.0) for r in quad.rotors))
    found = plan(load_problem("half-flip"), vehicle=prompt)
    assert found.certified
    assert found.order == 4


@pytest.mark.slow
def test_crackle_is_the_input_where_a_problem_limits_it(quad: Vehicle) -> None:
    prompt = replace(quad, rotors=tuple(replace(r, lag=0.0) for r in quad.rotors))
    found = plan(replace(load_problem("half-flip"), limits=Limits(crackle=2e5)), vehicle=prompt)
    assert found.certified
    assert found.order == 5


def test_thrusts_that_jump_are_not_certified_for_rotors_with_lag(quad: Vehicle) -> None:
    """Of a program's own path; what is refined jumps in nothing."""
    found = plan(load_problem("half-flip"), Miqp(order=4, search=BisectionSearch()), quad)
    assert not found.certified
    assert "rotor thrusts jump" in found.certificate.why


@pytest.mark.parametrize("name", ["line", "half-flip", pytest.param("flip-roll", marks=pytest.mark.slow)])
def test_no_shorter_duration_that_was_tried_flies(name: str, quad: Vehicle) -> None:
    found = plan(load_problem(name), Miqp(search=BisectionSearch(tolerance=0.01)), quad)
    assert all(not a.feasible for a in found.attempts if a.dt < found.dt)
    assert any(found.dt / 1.0101 <= a.dt < found.dt for a in found.attempts)


@pytest.fixture(scope="module")
def straight(quad: Vehicle) -> Plan:
    """A roll without limits per axis."""
    return plan(replace(load_problem("flip-roll"), limits=Limits()), vehicle=quad)


@pytest.mark.parametrize("axis_deg", [37.0, pytest.param(200.0, marks=pytest.mark.slow)])
def test_flips_about_any_horizontal_axis_are_the_same_flip_turned(
    axis_deg: float, straight: Plan, quad: Vehicle
) -> None:
    """Without per-axis limits nothing tells one heading from another."""
    roll = straight.problem
    heading = np.deg2rad(axis_deg + 90.0)  # thrust swings to the left of the axis, where the gate leads
    gate = tilted_gate(roll.gates[0].position, heading + np.pi, tilt=np.pi)
    turned = replace(roll, gates=(gate,), maneuver=Flip(axis_deg))
    about = plan(turned, vehicle=quad)
    assert about.duration == pytest.approx(straight.duration, rel=0.02)


@pytest.mark.parametrize(
    "tilt_deg", [80.0, *(pytest.param(tilt, marks=pytest.mark.slow) for tilt in (-90.0, -20.0, 0.0, 45.0))]
)
def test_the_half_flip_passes_a_gate_at_any_tilt_with_its_thrust_along_the_upright(
    tilt_deg: float, quad: Vehicle
) -> None:
    problem = load_problem("half-flip")
    gate = problem.gates[0].tilted(np.deg2rad(tilt_deg))
    problem = replace(problem, gates=(gate,))
    found = plan(problem, vehicle=quad)
    (passage,) = found.stages
    thrust = found.trajectory.evaluate(passage.time, 2) + [0.0, 0.0, STANDARD_GRAVITY]  # noqa: RUF005
    sideways = thrust - (thrust @ gate.normal) * gate.normal
    cosine = sideways @ gate.up / np.linalg.norm(sideways)
    assert np.arccos(min(cosine, 1.0)) <= 0.5 * gate.attitude_tolerance + 1e-9


def test_the_gate_is_passed_squarely() -> None:
    found = shared_plan("flip-roll")
    passage = next(s for s in found.stages if s.gate)
    velocity = found.trajectory.evaluate(passage.time, 1)
    normal = found.problem.gate(passage.gate).normal
    assert velocity @ normal == pytest.approx(np.linalg.norm(velocity), rel=1e-9)


def test_a_gate_that_asks_more_thrust_than_there_is_says_both_numbers(quad: Vehicle) -> None:
    problem = replace(load_problem("flip-roll"), maneuver=Flip(180.0, min_inverted_thrust=45.0))
    with pytest.raises(Infeasible, match=r"'gate' asks 45 m/s² inverted, agile-quad gives 32\.4"):
        plan(problem, vehicle=quad)


def test_ground_that_binds_is_named_as_such_where_there_are_no_limits_of_space() -> None:
    """A dive so near to it that the jerk allowed does not end it in time."""
    z, ends = (0.0, 0.0, 1.0), (at_rest((0.0, 0.0, 1.0)), at_rest((4.0, 0.0, 1.0)))
    bounds = ("velocity", -4.0), ("position", 1.0), ("acceleration", 0.0)
    dive = Stage("dive", tuple(Condition(name, z, upper=most) for name, most in bounds), at=(0.3, 0.6))
    free = Problem("low", *ends, CustomManeuver((dive,)), limits=Limits(jerk=1.0))
    assert plan(free, Miqp(), None).trajectory.evaluate(np.linspace(0.0, 14.0, 99))[:, 2].min() < 0.9
    with pytest.raises(Infeasible, match=r"environment.ground or limits.jerk .* binds"):
        plan(replace(free, environment=Environment(ground=0.9)), Miqp(), None)


def test_the_limit_that_binds_is_named() -> None:
    problem = replace(load_problem("line"), limits=Limits(velocity=0.1))
    with pytest.raises(Infeasible, match=r"limits.velocity \(0.1 m/s\) binds") as failure:
        plan(problem, Miqp(search=BisectionSearch(0.05, 0.5)), vehicle=None)
    assert len(failure.value.attempts) > 3
    assert not any(a.feasible for a in failure.value.attempts)


def test_running_out_of_time_is_not_called_infeasible() -> None:
    with pytest.raises(Infeasible, match=r"was found in 0 s; allow more with --time-limit") as failure:
        plan(load_problem("flip-roll"), Miqp(search=BisectionSearch(0.1, 0.12), time_limit=0.0), vehicle=None)
    assert {a.status for a in failure.value.attempts} == {"unknown"}


def test_an_optimal_plan_reports_its_bound() -> None:
    found = plan(load_problem("flip-roll").as_in_paper(), Miqp(order=3), vehicle=None)
    assert found.status == "optimal"
    assert found.bound == pytest.approx(found.cost, rel=1e-9)
    assert found.gap < 1e-9


def test_a_refined_plan_claims_no_bound() -> None:
    found = shared_plan("flip-roll")
    assert found.status == "locally optimal"
    assert found.cost == pytest.approx(found.duration)
    assert (found.bound, found.gap, found.dt) == (None, None, None)


def test_a_vehicle_too_weak_for_the_maneuver_is_told_which_rotor_lacks_what() -> None:
    weak = load_vehicle("agile-quad")
    weak = replace(weak, rotors=tuple(replace(r, max_thrust=2.2) for r in weak.rotors))
    with pytest.raises(Infeasible, match=r"agile-quad can fly: at best, .*rotor"):
        plan(load_problem("flip-roll"), Miqp(intervals=12, rescue=False), weak)


@pytest.mark.parametrize("intervals", [2, 3, 4])
def test_too_few_intervals_for_the_stages_is_a_sentence(intervals: int) -> None:
    with pytest.raises(SpecError, match="intervals"):
        plan(load_problem("flip-roll").as_in_paper(), Miqp(order=3, intervals=intervals), vehicle=None)


def test_two_intervals_suffice_for_nothing_to_do() -> None:
    still = Problem("still", at_rest((1.0, 2.0, 3.0)), at_rest((1.0, 2.0, 3.0)))
    found = plan(still, Miqp(intervals=2), vehicle=None)
    assert found.cost == pytest.approx(0.0, abs=1e-12)


def test_a_hover_is_no_reason_to_look_for_a_shorter_one(quad: Vehicle) -> None:
    """Its millisecond was called suspiciously long beside a lower bound of zero, for half a minute."""
    found = plan(Problem("still", at_rest((1.0, 2.0, 3.0)), at_rest((1.0, 2.0, 3.0))), Miqp(), quad)
    assert found.duration < 0.02
    assert not found.rescue
    assert not found.wants_second_opinion


@pytest.mark.slow
def test_a_gate_at_the_start_is_planned_like_any_other(quad: Vehicle) -> None:
    problem = load_problem("flip-roll")
    gate = replace(problem.gates[0], position=problem.start.position)
    found = plan(replace(problem, gates=(gate,)), vehicle=quad)
    placed = next(s for s in found.stages if s.gate)
    np.testing.assert_allclose(found.trajectory.evaluate(placed.time), problem.start.position, atol=1e-6)


@pytest.mark.parametrize("heading", [pytest.param(-np.pi, marks=pytest.mark.slow), np.pi / 2])
def test_a_symmetric_vehicle_flies_the_same_plan_at_any_multiple_of_90_degrees_of_heading(
    heading: float, quad: Vehicle
) -> None:
    turned = plan(replace(load_problem("flip-roll"), heading=heading), vehicle=quad)
    assert turned.duration == pytest.approx(shared_plan("flip-roll").duration, rel=2e-3)


def test_a_moving_start_and_goal_are_met(quad: Vehicle) -> None:
    ends = EndState((0, 0, 1), (3, 0, 0), (0, 1, 0)), EndState((6, 1, 2), (0, 2, 0), (0, 0, 1))
    found = plan(Problem("moving", *ends, limits=Limits(velocity=8.0)), vehicle=quad)
    for end, t in zip(ends, (0.0, found.duration), strict=True):
        for derivative in range(3):
            wanted = end.derivatives(3)[derivative]
            np.testing.assert_allclose(found.trajectory.evaluate(t, derivative), wanted, atol=1e-5)


def test_the_half_flip_of_the_example_passes_its_gate_at_twice_the_papers_speed(quad: Vehicle) -> None:
    found = plan(load_problem("examples/fast-half-flip.toml"), vehicle=quad)
    assert isinstance(found.problem.maneuver, HalfFlip)
    (gate,) = found.stages
    assert np.linalg.norm(found.trajectory.evaluate(gate.time, 1)) >= 16.0
    assert found.certified
