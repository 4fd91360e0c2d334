"""Plans follow the heading that their problems ask for, as closely as the rotors allow, on the same path."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import aerobat as ab
from aerobat import so3
from aerobat.declaration import from_table, to_table
from aerobat.errors import Infeasible, SpecError
from aerobat.planning.heading.follow import heading_error, with_heading
from aerobat.planning.heading.yaw_spline import YawSpline
from aerobat.reporting.facts import facts
from aerobat.trajectory import Trajectory
from shared_plans import shared_plan

RESERVE = 0.15  # of shared plans
SLOW = ab.Limits(velocity=2.0, acceleration=2.0)


def following(name: str, **heading: Any) -> ab.Plan:
    """A shared plan with a heading."""
    plan = shared_plan(name)
    return with_heading(replace(plan, problem=replace(plan.problem, heading=ab.Heading(**heading))), RESERVE)


def test_without_a_heading_a_plan_is_what_it_was() -> None:
    plan = shared_plan("line")
    assert with_heading(plan, RESERVE) is plan
    assert heading_error(plan) is None


def test_a_spline_is_followed_through_a_fast_line() -> None:
    plan, still = following("line", mode="spline", knots_deg=[[0.5, 90], [1, 180]]), shared_plan("line")
    assert plan.certified
    error = heading_error(plan)
    assert error is not None
    assert error.largest < np.deg2rad(1.0)
    times = np.linspace(0.0, still.duration, 300)
    moved = plan.trajectory.evaluate(times) - still.trajectory.evaluate(times)
    assert np.abs(moved).max() < 1e-12
    ends = ab.reference(plan, times=[0.0, plan.duration]).setpoint
    turned = so3.about_axis(so3.UP, np.array([0.0, np.pi]))
    assert np.rad2deg(so3.angle_between(ends.q_world_body, turned)).max() < 1.0
    np.testing.assert_allclose(ends.omega_body, 0.0, atol=1e-6)


def test_a_slow_flight_looks_at_its_point_all_the_way() -> None:
    asked = ab.Heading(np.pi / 4, "towards", point=(5.0, 5.0, 0.0))
    problem = replace(ab.load_problem("line"), limits=SLOW, heading=asked)
    plan = ab.plan(problem)
    assert plan.certified
    flight = ab.fly(plan)
    away = asked.point - flight.states.position
    ahead = so3.rotate(flight.states.q_world_body, [1.0, 0.0, 0.0])
    off = np.arctan2(ahead[:, 1], ahead[:, 0]) - np.arctan2(away[:, 1], away[:, 0])
    assert np.rad2deg(np.abs(off)).max() < 5.0
    error = heading_error(plan)
    assert error is not None
    assert np.rad2deg(error.largest) < 3.0


def test_a_flip_keeps_a_fixed_heading_without_a_turn() -> None:
    plan = following("flip-roll", mode="fixed")
    assert np.abs(plan.trajectory.yaw).max() < 1e-3


def test_what_turns_too_fast_is_followed_as_far_as_rotors_go() -> None:
    plan = following("line", mode="spline", knots_deg=[[0.4, 0.0], [0.6, 360.0], [1.0, 0.0]])
    error = heading_error(plan)
    assert plan.certified
    assert error is not None
    assert error.largest > np.deg2rad(5.0)


@pytest.mark.parametrize("plan", ["line", "half-flip"])
def test_a_turn_leaves_the_controller_half_of_its_reserve(plan: str) -> None:
    assert following(plan, mode="spline", knots_deg=[[0.4, 0.0], [0.6, 360.0], [1.0, 0.0]]).keeps(
        0.5 * RESERVE
    )


def test_a_path_that_keeps_no_reserve_is_turned_within_its_limits() -> None:
    still = shared_plan("line")
    asked = ab.Heading(mode="spline", knots_deg=[[0.5, 90.0], [1.0, 180.0]])
    plan = with_heading(replace(still, problem=replace(still.problem, heading=asked)), 0.32)
    assert not still.keeps(0.16)
    assert plan.certified
    assert np.abs(plan.trajectory.yaw).max() > 0.5


def test_an_error_beyond_a_hundred_degrees_is_reported_in_whole_degrees() -> None:
    plan = shared_plan("line")
    turned = replace(
        plan,
        problem=replace(plan.problem, heading=ab.Heading(mode="fixed")),
        trajectory=replace(plan.trajectory, heading=np.deg2rad(135.0)),
    )
    (fact,) = (fact for fact in facts(turned) if fact.label == "heading")
    assert fact.text.startswith("fixed, 135° off, at worst 135° at ")


@pytest.mark.slow
def test_a_turn_is_sought_between_none_and_what_is_asked() -> None:
    error = heading_error(following("half-flip", mode="spline", knots_deg=[[0.1, 120.0], [1.0, 120.0]]))
    assert error is not None
    assert error.median < np.deg2rad(60.0)  # 80°, where only no turn and whole ones begin a search


@pytest.mark.slow
def test_a_lap_that_follows_its_velocity_closes() -> None:
    plan = ab.plan(replace(ab.load_problem("lap-7"), heading=ab.Heading(mode="along-velocity")))
    assert plan.certified
    error = heading_error(plan)
    assert error is not None
    assert error.median < np.deg2rad(2.0)


def test_a_tolerance_that_is_not_kept_is_refused_in_a_sentence() -> None:
    with pytest.raises(Infeasible, match=r"off what is asked at .* s, more than heading\.tolerance_deg = 5"):
        following("line", mode="towards", point=(5.0, 5.0, 0.0), tolerance_deg=5.0)


def test_without_a_vehicle_no_heading_is_followed() -> None:
    with pytest.raises(SpecError, match="heading: how fast it may turn, a vehicle says"):
        ab.plan(replace(ab.load_problem("line"), heading=ab.Heading(mode="fixed")), vehicle=None)


@pytest.mark.parametrize(
    "heading",
    [
        {"mode": "towards", "point": [1.0, 2.0, 3.0]},
        {"mode": "spline", "knots_deg": [[0.0, 30.0], [1.0, 90.0]], "start": np.pi / 6},
        {"mode": "fixed", "tolerance_deg": 5.0},
        {"start": 1.0},
    ],
)
def test_a_problem_with_a_heading_is_its_table(heading: dict[str, Any]) -> None:
    table = to_table(ab.load_problem("line")) | {"heading": heading}
    problem = from_table(ab.Problem, table)
    assert from_table(ab.Problem, to_table(problem)) == problem


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"mode": "towards"}, r"heading\.point is missing for towards; add it"),
        ({"point": [1.0, 2.0, 3.0]}, r'heading\.point is for mode = "towards"; drop it'),
        ({"mode": "spline", "knots_deg": [[0.5, 1.0], [0.2, 3.0]]}, "rising fractions from 0 to 1"),
        ({"mode": "spline", "knots_deg": [1.0]}, "must be rows"),
        ({"mode": "spline", "knots_deg": [[0.0, 10.0]]}, "begins with 10°, heading_deg is 0"),
    ],
)
def test_a_heading_that_makes_no_sense_is_refused(wrong: dict[str, Any], sentence: str) -> None:
    with pytest.raises(SpecError, match=sentence):
        from_table(ab.Problem, to_table(ab.load_problem("line")) | {"heading": wrong})


def test_the_start_is_given_once() -> None:
    table = to_table(ab.load_problem("line")) | {"heading_deg": 90.0}
    found = from_table(ab.Problem, table | {"heading": {"mode": "fixed"}})
    assert found.heading == ab.Heading(np.pi / 2, "fixed")
    for start in (1.0, {"start": 1.0}):
        with pytest.raises(SpecError, match="heading_deg"):
            from_table(ab.Problem, table | {"heading": start})


def test_a_path_that_is_cut_stays_itself() -> None:
    path = shared_plan("half-flip").trajectory
    cut = YawSpline.along(path).cut_path
    times = np.linspace(0.0, path.duration, 500)
    assert cut.segments > path.segments
    for derivative, close in enumerate((1e-13, 1e-12, 1e-10, 1e-9, 1e-7)):
        np.testing.assert_allclose(
            cut.evaluate(times, derivative), path.evaluate(times, derivative), atol=close
        )
    whole = Trajectory([0.1, 0.1], path.coefficients[:2])
    assert YawSpline.along(whole).cut_path == whole
