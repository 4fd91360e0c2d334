"""The lower bound on durations: no motion beats it, whoever made it, and it comes near to the best."""

from dataclasses import replace
from math import expm1, inf, sqrt
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat.planning import least_duration
from aerobat.planning.assessment import lower_bound
from aerobat.planning.assessment.damped_point import DampedPoint
from aerobat.planning.assessment.lower_bound import max_angular_acceleration
from aerobat.problem import Problem, Waypoint, Waypoints, at_rest
from random_problems import random_case
from suites import examples

thrusts = st.floats(0.5, 60.0)
dampings = st.sampled_from([0.0, 1e-6, 0.05, 0.5, 3.0])
fractions = st.floats(0.0, 1.0)
QUAD = ab.load_vehicle("agile-quad")
DRAGGY = replace(QUAD, drag_body=(0.3, 0.3, 0.15))


def moved(velocity: float, thrust: float, damping: float, time: float) -> tuple[float, float]:
    """Distance and velocity after some time at a constant thrust."""
    if damping == 0.0:
        return velocity * time + 0.5 * thrust * time**2, velocity + thrust * time
    final, decayed = thrust / damping, -expm1(-damping * time)
    after = velocity + (final - velocity) * decayed
    return final * time - (after - velocity) / damping, after


@given(
    thrusts,
    thrusts,
    dampings,
    st.floats(-8.0, 8.0),
    st.lists(st.tuples(fractions, st.floats(0.01, 1.0)), min_size=1, max_size=6),
)
def test_no_course_of_the_thrust_gets_anywhere_sooner(
    forward: float, backward: float, damping: float, start: float, course: list[tuple[float, float]]
) -> None:
    velocity, distance, fastest = start, 0.0, start
    for fraction, time in course:
        covered, velocity = moved(velocity, fraction * (forward + backward) - backward, damping, time)
        distance += covered
        fastest = max(fastest, velocity)
    spent = sum(time for _, time in course)
    if distance >= 0.0:
        for limit in (inf, max(fastest, 0.0) + 1e-9):
            point = DampedPoint(forward, backward, damping, limit)
            assert point.least_time(distance, start, velocity) <= spent * (1.0 + 1e-6) + 1e-6


@examples(40)
@given(thrusts, thrusts, dampings, st.floats(0.01, 50.0), st.floats(0.5, 20.0))
def test_the_least_time_is_that_of_a_motion(
    forward: float, backward: float, damping: float, distance: float, limit: float
) -> None:
    """At full thrust, at the limit, and at full thrust backward for what is left, it arrives at rest."""
    point = DampedPoint(forward, backward, damping, limit)
    total = point.least_time(distance)
    low, high = 0.0, total
    for _ in range(60):  # how long it speeds up, such that it is at rest at the end of its time
        middle = 0.5 * (low + high)
        covered, peak = moved(0.0, forward, damping, middle)
        braking = peak / backward if damping == 0.0 else np.log1p(damping * peak / backward) / damping
        cruise = total - middle - braking
        low, high = (middle, high) if cruise > 0.0 and peak < limit else (low, middle)
    reached = covered + max(cruise, 0.0) * peak + moved(peak, -backward, damping, braking)[0]
    assert reached == pytest.approx(distance, rel=1e-4, abs=1e-5)


@examples(60)
@given(thrusts, thrusts, dampings, st.floats(-8.0, 8.0), st.sampled_from([1.0, 1.0 + 1e-9, 0.5, 2.0]))
def test_a_velocity_is_reversed_over_no_distance_in_a_time_that_is_found(
    forward: float, backward: float, damping: float, start: float, factor: float
) -> None:
    """Where ends lie at one place, rounding may make a way of what is none, and drag may be too large."""
    found = DampedPoint(forward, backward, damping).least_time(0.0, start, -factor * start)
    assert 0.0 <= found < inf
    if damping == 0.0 and factor == 1.0:
        thrust = backward if start > 0.0 else forward
        assert found == pytest.approx(2.0 * abs(start) / thrust, rel=1e-6)


def test_from_rest_to_rest_without_drag_it_is_the_textbooks_bang_bang() -> None:
    assert DampedPoint(4.0, 9.0).least_time(5.0) == pytest.approx(sqrt(10.0 * (1 / 4.0 + 1 / 9.0)))


@pytest.mark.slow
@pytest.mark.parametrize("k", [1, 4, 5, 6])
def test_no_plan_of_the_miqp_beats_it(k: int) -> None:
    case = random_case(11, k)
    found = ab.plan(case.problem, ab.Miqp(rescue=False), case.vehicle)
    assert found.assessment is not None
    assert found.assessment.ratio >= 1.0
    assert found.assessment.least_duration == least_duration(case.problem, case.vehicle)


@pytest.mark.slow
def test_no_polynomials_of_free_knots_beat_it() -> None:
    case = random_case(12, 0)
    found = ab.plan(case.problem, ab.FreeKnots(segments=2), case.vehicle)
    assert found.assessment is not None
    assert found.assessment.ratio >= 1.0


@pytest.mark.slow
def test_time_optimal_motion_comes_near_to_it_and_never_under() -> None:
    found = ab.plan(ab.load_problem("half-flip"), ab.TimeOptimal(starts=1), QUAD)
    assert found.assessment is not None
    assert 1.0 <= found.assessment.ratio < 1.1


@pytest.mark.parametrize("name", ["flip-roll", "half-flip", "line", "section-v"])
@pytest.mark.parametrize("vehicle", [QUAD, DRAGGY], ids=["no drag", "drag"])
def test_it_is_the_same_backward_where_nothing_drags_and_never_zero(name: str, vehicle: ab.Vehicle) -> None:
    problem = ab.load_problem(name)
    there = least_duration(problem, vehicle)
    assert there > 0.5
    if vehicle is QUAD and name == "line":
        back = least_duration(replace(problem, start=problem.goal, goal=problem.start), vehicle)
        assert back == pytest.approx(there, rel=1e-9)


@examples(10)
@given(st.floats(1.2, 3.0))
def test_more_thrust_never_lengthens_it(factor: float) -> None:
    rotors = tuple(replace(rotor, max_thrust=factor * rotor.max_thrust) for rotor in QUAD.rotors)
    for name in ("flip-roll", "half-flip", "section-v"):
        problem = ab.load_problem(name)
        assert least_duration(problem, replace(QUAD, rotors=rotors)) <= least_duration(problem, QUAD)


def test_what_is_asked_on_the_way_never_shortens_it() -> None:
    """Half-way points that double back: each of them, added, takes its time."""
    before = 0.0
    for count in range(4):
        points = [(3.0, 0.0, 0.0), (-2.0, 0.0, 0.0), (4.0, 1.0, 0.0)][:count]
        waypoints = tuple(ab.Waypoint(point) for point in points)
        maneuver = ab.Waypoints(waypoints) if waypoints else ab.Line()
        ends = ab.at_rest((0.0, 0.0, 0.0)), ab.at_rest((1.0, 0.0, 0.0))
        problem = ab.Problem("zigzag", *ends, maneuver)
        after = least_duration(problem, QUAD)
        assert after > 1.2 * before
        before = after


def test_a_condition_that_follows_from_others_never_lengthens_it() -> None:
    """A place fixed along three axes that are those of nothing else, and once more along their diagonal."""
    place, axes = (
        np.array([4.0, 1.0, 0.5]),
        np.array([[2.0, -1.0, 2.0], [2.0, 2.0, -1.0], [-1.0, 2.0, 2.0]]) / 3,
    )
    fixed = [
        ab.Condition("position", tuple(along), float(along @ place), float(along @ place))
        for along in (*axes, axes.sum(axis=0) / sqrt(3.0))
    ]
    ends = ab.at_rest((0.0, 0.0, 0.0)), ab.at_rest((0.0, 0.0, 0.0))
    three, four = (
        least_duration(
            ab.Problem("there", *ends, ab.CustomManeuver((ab.Stage("there", tuple(fixed[:count])),))), QUAD
        )
        for count in (3, 4)
    )
    assert 1.0 < four <= three


def test_stages_in_no_order_count_one_at_a_time() -> None:
    stages = tuple(
        ab.Stage(f"x = {x:g}", (ab.Condition("position", (1.0, 0.0, 0.0), x, x),)) for x in (4.0, -4.0)
    )
    ends = ab.at_rest((0.0, 0.0, 0.0)), ab.at_rest((0.0, 0.0, 0.0))
    ordered, free = (
        least_duration(ab.Problem("both", *ends, ab.CustomManeuver(stages, ordered=o)), QUAD)
        for o in (True, False)
    )
    one = least_duration(ab.Problem("one", *ends, ab.CustomManeuver(stages[:1])), QUAD)
    assert free == pytest.approx(one)
    assert ordered > 1.5 * free


def test_no_rotor_thrusts_turn_the_body_faster_than_the_largest_angular_acceleration() -> None:
    rng = np.random.default_rng(0)
    for name in ab.vehicle_names():
        vehicle = ab.load_vehicle(name)
        corners = rng.integers(0, 2, (200, len(vehicle.rotors)))
        rotors = np.where(corners == 1, vehicle.max_thrusts, vehicle.min_thrusts)
        turned = np.linalg.solve(vehicle.inertia, (rotors @ vehicle.allocation.T)[:, 1:].T)[:2]
        reached = np.linalg.norm(turned, axis=0).max()
        assert (
            0.99 * max_angular_acceleration(vehicle) <= reached <= 1.0001 * max_angular_acceleration(vehicle)
        )


def test_a_long_course_is_bounded_in_few_legs_and_as_high_as_by_all_of_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """All pairs of stages, along all directions between them, made a hundred waypoints take a minute."""
    legs: list[int] = []

    def counted(*leg: Any) -> float:
        legs.append(1)
        return one_leg(*leg)

    one_leg = lower_bound._leg
    monkeypatch.setattr(lower_bound, "_leg", counted)
    places = np.cumsum(np.random.default_rng(3).normal(scale=4.0, size=(42, 3)), axis=0).tolist()
    waypoints = tuple(Waypoint(position=tuple(place)) for place in places[1:-1])
    course = Problem(
        name="course", start=at_rest(places[0]), goal=at_rest(places[-1]), maneuver=Waypoints(waypoints)
    )
    found, few = least_duration(course, QUAD), len(legs)
    monkeypatch.setattr(lower_bound, "_not_surpassed", lambda longest: longest)
    legs.clear()
    assert least_duration(course, QUAD) == found
    assert few < 0.3 * len(legs)
