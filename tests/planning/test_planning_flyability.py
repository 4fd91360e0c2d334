"""A plan flies itself before it is returned: what its loop of controller and rotors makes of it is said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import aerobat as ab
from aerobat.errors import SpecError
from aerobat.planning import (
    FLYABLE_ERROR,
    Flyability,
    PlacedStage,
    own_flight,
    with_second_opinion,
)
from aerobat.planning.flyability import disturbed_flight
from aerobat.planning.task import Task
from aerobat.reporting.plain_data import plain
from aerobat.reporting.plans import _margin as margin_in_words
from aerobat.reporting.report import Report
from aerobat.simulation import Outcome
from aerobat.trajectory import Trajectory
from random_problems import random_case
from shared_plans import shared_plan

QUAD = ab.load_vehicle("agile-quad")
CRAZYFLIE = ab.load_vehicle("crazyflie")


@pytest.fixture(scope="module")
def plan() -> ab.Plan:
    windy = ab.Environment(gravity=9.7, wind=(1.0, -0.5, 0.2))
    problem = replace(ab.load_problem("half-flip"), heading=0.4, environment=windy)
    return ab.plan(problem, vehicle=replace(QUAD, drag_body=(0.1, 0.1, 0.05)))


def flyability(plan: ab.Plan) -> Flyability:
    assert plan.flyability is not None
    return plan.flyability


def sagging() -> ab.Plan:
    """A plan for a vehicle whose controller is too slow for it, of which the certificate knows nothing."""
    slow = replace(ab.Controller.paper(), attitude_frequency=12.0)
    return shared_plan("half-flip").for_vehicle(replace(QUAD, controller=slow))


def test_flyability_is_the_score_of_the_plan_s_own_flight(plan: ab.Plan) -> None:
    error = ab.score(ab.fly(plan), plan).max_position_error_m
    assert flyability(plan).error == pytest.approx(error, rel=1e-9)
    assert plan.vehicle is not None
    assert own_flight(plan.evidence.task, plan.trajectory, plan.stages).error == flyability(plan).error
    assert 0.0 < error < FLYABLE_ERROR
    assert plan.flies


def test_where_unequal_drag_tilts_the_path_in_a_gate_a_larger_tolerance_is_the_remedy() -> None:
    for drag, unequal in (((0.0, 0.8, 0.0), True), ((0.4, 0.4, 0.0), False)):
        tilted = shared_plan("half-flip").for_vehicle(replace(QUAD, drag_body=drag))
        assert tilted.certificate is not None
        assert "attitude" in {f.name for f in tilted.certificate.findings if f.verdict == "violated"}
        assert ("attitude_tolerance_deg" in flyability(tilted).remedy) is unequal


def test_the_reserve_is_what_the_certificate_leaves(plan: ab.Plan) -> None:
    assert plan.certificate is not None
    assert plan.vehicle is not None
    found = flyability(plan)
    assert found.disturbance == plan.certificate.margin
    assert found.disturbed_fraction == found.disturbance / plan.vehicle.max_thrusts.max()


def test_rotors_that_give_less_let_a_hovering_vehicle_fall_by_as_much_of_gravity() -> None:
    hover = Trajectory([1.0], [[[0.0, 0.0, 1.0]]])
    fraction, environment = 0.03, ab.Environment()
    flight = disturbed_flight(hover, CRAZYFLIE, environment, fraction)
    velocity, time = flight.states.velocity[1], flight.times[1]
    assert velocity[2] / time == pytest.approx(-fraction * environment.gravity, rel=1e-3)
    nominal = disturbed_flight(hover, CRAZYFLIE, environment, 0.0)
    assert nominal.position_error.max() < 1e-9


def test_less_thrust_costs_more_error(plan: ab.Plan) -> None:
    found = flyability(plan)
    assert found.error < found.disturbed_error
    assert plan.vehicle is not None
    flight = disturbed_flight(
        plan.trajectory, plan.vehicle, plan.problem.environment, found.disturbed_fraction
    )
    assert found.disturbed_error == flight.position_error.max()


def test_without_a_reserve_nothing_is_bought(plan: ab.Plan) -> None:
    heavy = replace(QUAD, mass=2.5 * QUAD.mass)
    bare = plan.for_vehicle(heavy)
    assert not bare.certified
    assert flyability(bare).disturbance == flyability(bare).disturbed_fraction == 0.0
    assert flyability(bare).disturbed_error == flyability(bare).error


def test_a_flight_that_diverges_without_the_reserve_has_no_distance(plan: ab.Plan) -> None:
    """The radius at which a flight is given up read as "moves the vehicle 5 m off its path"."""
    found = replace(flyability(plan), disturbed_error=5.01)
    assert str(found).endswith("with as much less from all rotors it diverges")
    assert margin_in_words(found).endswith("; with a loss as large it diverges from its path")


def test_a_certified_plan_that_does_not_fly_says_so_as_a_defect_of_its_own() -> None:
    plan = sagging()
    assert plan.certified
    assert not plan.flies
    assert flyability(plan).error > FLYABLE_ERROR
    for text in (str(plan), str(plain(Report(plan))["plan"]["flyability"]["sentence"])):
        assert "a defect of the plan, not of the flight" in text
        assert text.count("keep more reserve for the controller, or take another planner") == 1
    assert plain(Report(plan))["plan"]["flyability"]["flies"] is False


def test_a_plan_whose_flight_does_not_hold_the_gate_s_attitude_says_so(plan: ab.Plan, tmp_path: Path) -> None:
    """Its gate, turned later by half a degree and asked to be passed exactly."""
    (gate,) = plan.problem.gates
    turned = gate.tilted(np.deg2rad(89.5))
    stricter = replace(plan.problem, gates=(replace(turned, attitude_tolerance=np.deg2rad(0.2)),))
    strict = replace(plan, problem=stricter)
    (passage,) = flyability(strict).passages
    (scored,) = ab.score(ab.fly(strict), strict).passages
    assert passage.attitude_error is not None
    assert np.rad2deg(passage.attitude_error) == pytest.approx(scored.attitude_error_deg)
    assert scored.attitude_error_deg > 0.2
    assert not strict.flies
    sentence = f"its own flight passed gate 'gate' {scored.attitude_error_deg:.1f}° off the attitude asked"
    assert sentence in str(strict)
    assert "0.2° allowed, a defect of the plan" in str(strict)
    (facts,) = plain(Report(strict))["plan"]["flyability"]["passages"]
    assert facts["failure"] == passage.failure
    assert facts["attitude_error_deg"] == pytest.approx(scored.attitude_error_deg)
    assert facts["attitude_tolerance_deg"] == pytest.approx(0.2)
    strict.save(tmp_path / "strict.plan")
    assert ab.load_plan(tmp_path / "strict.plan").flyability == strict.flyability


def test_a_plan_that_only_looks_through_its_gate_does_not_fly() -> None:
    """Into the plane by 4 cm and back: that passes no gate, says the score, and so says the plan."""
    s = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6]).coef
    there, back = np.outer(s, [1.04, 0.0, 0.0]), np.outer(s, [-1.04, 0.0, 0.0])
    back[0, 0] = 1.04
    path = Trajectory([2.0, 2.0], [there, back])
    gate = ab.tilted_gate((1.0, 0.0, 0.0))
    crossing = np.polynomial.Polynomial([-1.0, *(1.04 * s[1:])]).roots()
    time = 2.0 * next(root.real for root in crossing if abs(root.imag) < 1e-9 and 0.0 < root.real < 1.0)
    problem = ab.Problem("look", ab.at_rest((0, 0, 0)), ab.at_rest((0, 0, 0)), gates=(gate,))
    looking = ab.Plan(problem, path, "by hand", stages=(PlacedStage("gate", 0, time, "gate"),), vehicle=QUAD)
    found = looking
    assert flyability(found).error < FLYABLE_ERROR
    assert not found.flies
    assert ab.score(ab.fly(found), found).outcome is Outcome.STOPPED_IN_GATE
    assert "its own flight stopped in gate 'gate', 3.9 cm beyond its plane" in str(found)


@pytest.mark.slow
def test_the_miqp_passes_faster_through_a_gate_that_its_path_would_turn_back_in() -> None:
    case = random_case(0, 147, ("flip", "half-flip"))
    made = ab.plan(case.problem, vehicle=case.vehicle)
    assert made.certified
    assert made.flies
    assert ab.score(ab.fly(made), made).outcome is Outcome.THROUGH_GATES


@pytest.mark.slow
def test_the_miqp_goes_straight_through_a_gate_whose_frame_it_would_touch() -> None:
    case = random_case(44, 129)  # as shortened, its path comes into the gate along its plane
    made = ab.plan(case.problem, vehicle=case.vehicle)
    assert made.certified
    assert made.flies


def test_a_flight_that_diverges_is_no_small_error() -> None:
    """It is lost, wherever it was last."""
    away = Trajectory([1.0], [[[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [90.0, 0.0, 0.0]]])
    assert own_flight(Task.of(ab.load_problem("line"), QUAD), away, ()).error >= 5.0


def test_flyability_survives_the_plan_s_file(plan: ab.Plan, tmp_path: Path) -> None:
    plan.save(tmp_path / "half.plan")
    assert ab.load_plan(tmp_path / "half.plan").flyability == plan.flyability


def test_the_evidence_is_that_of_the_plan_s_own_vehicle_and_path(plan: ab.Plan) -> None:
    assert plan.flies
    assert not plan.for_vehicle(CRAZYFLIE).flies
    assert replace(plan, vehicle=CRAZYFLIE).certificate == ab.certify(
        plan.trajectory,
        CRAZYFLIE,
        plan.problem.environment,
        Task.of(plan.problem, CRAZYFLIE).envelope(plan.stages),
    )
    slower = replace(plan.trajectory, durations=1.1 * plan.trajectory.durations)
    assert replace(plan, trajectory=slower).certificate != plan.certificate


def test_a_plan_without_a_vehicle_flies_nothing() -> None:
    plan = ab.plan(ab.load_problem("line"), vehicle=None)
    assert plan.flyability is None
    with pytest.raises(SpecError, match="plan it for one"):
        with_second_opinion(plan)
