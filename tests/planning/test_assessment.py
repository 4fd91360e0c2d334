"""A plan beside what is possible and usual: what is poor, goes astray, dives or spins too fast says so."""

from dataclasses import replace
from functools import cache
from math import cos, radians, sin
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import aerobat as ab
from aerobat.planning import Plan, SecondOpinion, with_second_opinion
from aerobat.planning.rotor_margin import RotorMargin
from aerobat.reporting.figures import report_figure
from aerobat.reporting.plain_data import plain
from aerobat.reporting.report import Report
from aerobat.reporting.style import RED
from aerobat.reporting.tables import table
from aerobat.vehicle import Rotor
from shared_plans import shared_plan

QUAD = ab.load_vehicle("agile-quad")
LINE = ab.Problem("line", ab.at_rest((0.0, 0.0, 1.0)), ab.at_rest((4.0, 0.0, 1.0)))


@cache
def line() -> Plan:
    """The plan of LINE."""
    return ab.plan(LINE, vehicle=QUAD)


def nimble(drag_body: tuple[float, float, float]) -> ab.Vehicle:
    """The quadrotor of 0.65 kg and rotors of 14 N with which a double flip once took 29 s."""
    rotors = tuple(
        Rotor((0.1 * x, 0.1 * y, 0.0), spin, 0.1, 14.0, 0.014, 0.0, 0.0635)
        for x, y, spin in ((1, 1, -1), (-1, -1, -1), (1, -1, 1), (-1, 1, 1))
    )
    return ab.Vehicle("nimble", 0.65, (0.003, 0.003, 0.005), rotors, drag_body)


def double_flip() -> ab.Problem:
    """Seven stages, a quarter of a turn apart, in place."""
    stages = []
    for angle in np.arange(90.0, 720.0, 90.0):
        along = (0.0, -sin(radians(angle)), cos(radians(angle)))
        across = (0.0, cos(radians(angle)), sin(radians(angle)))
        conditions = (
            ab.Condition("specific_thrust", along, lower=6.0),
            ab.Condition("specific_thrust", across, 0.0, 0.0),
        )
        stages.append(ab.Stage(f"{angle:g}°", conditions))
    there = ab.at_rest((0.0, 0.0, 1.0))
    return ab.Problem("double-flip", there, there, ab.CustomManeuver(tuple(stages)))


def along(positions: list[tuple[float, float, float]], duration: float = 4.0) -> Plan:
    """A plan of LINE by way of points at equal times, assessed."""
    fixed = [
        [p, *(None,) * 3] if 0 < i < len(positions) - 1 else [p, *((0.0,) * 3,) * 3]
        for i, p in enumerate(positions)
    ]
    values = np.full((len(positions), 4, 3), np.nan)
    for i, row in enumerate(fixed):
        for k, value in enumerate(row):
            if value is not None:
                values[i, k] = value
    path = ab.minimum_effort(values, np.full(len(positions) - 1, duration / (len(positions) - 1)))
    return Plan(LINE, path, "by hand", vehicle=QUAD)


def begun_later(plan: Plan, seconds: float) -> Plan:
    """Return the plan with so long a rest at its start."""
    path = plan.trajectory
    rest = np.zeros((1, *path.coefficients.shape[1:]))
    rest[0, 0] = path.evaluate(0.0)
    late = ab.Trajectory([seconds, *path.durations], np.concatenate([rest, path.coefficients]))
    return Plan(plan.problem, late, "by hand", vehicle=plan.vehicle)


@pytest.mark.slow
def test_a_half_flip_on_the_papers_vehicle_is_proven_near_the_best() -> None:
    """It once took 8.48 s, where time-optimal takes 1.93, and nothing hinted at it."""
    found = ab.plan(ab.load_problem("half-flip"), vehicle=ab.load_vehicle("section-v"))
    assert found.assessment is not None
    assert found.assessment.ratio < 1.4
    assert found.assessment.warnings == ()


@pytest.mark.slow
def test_a_double_flip_that_is_poor_says_so_and_names_what_does_better() -> None:
    vehicle = nimble((0.3, 0.3, 0.15))
    found = with_second_opinion(begun_later(ab.plan(double_flip(), "free-knots", vehicle), 2.0))
    assessment = found.assessment
    assert assessment is not None
    assert assessment.opinion is not None
    assert assessment.opinion.duration is not None
    assert assessment.poor == (found.duration > 1.4 * assessment.opinion.duration)
    assert assessment.poor
    assert str(assessment).startswith("poor: ")
    assert f"{assessment.opinion.duration:.3f} s ({assessment.opinion.options})" in str(found)


def test_a_line_that_takes_twice_the_time_it_need_says_so_and_names_what_does_better() -> None:
    found = with_second_opinion(along([(0.0, 0.0, 1.0), (2.0, 0.0, 1.0), (4.0, 0.0, 1.0)]))
    assert found.assessment is not None
    assert found.assessment.opinion is not None
    assert found.assessment.opinion.duration is not None
    assert found.assessment.opinion.duration < found.duration / 2.0
    assert str(found.assessment).startswith("poor: ")
    assert f"{found.assessment.opinion.duration:.3f} s ({found.assessment.opinion.options})" in str(found)


def test_a_plan_that_takes_long_for_its_reserve_is_not_poor(tmp_path: Path) -> None:
    found = along([(0.0, 0.0, 1.0), (2.0, 0.0, 1.0), (4.0, 0.0, 1.0)], duration=1.41)
    with_reserve = replace(found, reserve=0.265)
    assert with_reserve.keeps(0.265)
    with_reserve.save(tmp_path / "reserve.plan")
    told = with_second_opinion(ab.load_plan(tmp_path / "reserve.plan")).assessment
    assert not told.poor
    assert told.opinion.options == "--planner free-knots --reserve 0.265"
    assert f"; free-knots finds {told.opinion.duration:.3f} s (" in str(told)


def test_a_plan_tells_the_reserve_that_its_planner_was_to_keep() -> None:
    assert line().reserve == 0.15
    assert ab.plan(LINE, ab.MinSnap(), QUAD).reserve == 0.0


@pytest.mark.parametrize("fraction", [0.5, 0.9])
def test_a_second_opinion_names_the_planner_that_its_options_choose(fraction: float) -> None:
    own = line().assessment
    assert own is not None
    duration = fraction * own.duration
    found = replace(own, opinion=SecondOpinion("--planner time-optimal", duration))
    assert found.sentence.endswith(f"; time-optimal finds {duration:.3f} s (--planner time-optimal)")


def test_a_plan_that_is_proven_near_the_best_is_given_no_second_opinion() -> None:
    found = shared_plan("line")
    assert with_second_opinion(found) is found


def test_a_plan_of_a_hundred_times_its_size_raises_an_alarm() -> None:
    near = along([(0.0, 0.0, 1.0), (2.0, 0.4, 1.3), (4.0, 0.0, 1.0)])
    assert near.assessment is not None
    assert near.assessment.warnings == ()
    far = along([(0.0, 0.0, 1.0), (2.0, 400.0, 1.3), (4.0, 0.0, 1.0)])
    assert "goes astray: 400 m beyond start, goal, gates and stages" in str(far)


def test_a_dive_is_told_unless_a_ground_bounds_it() -> None:
    found = along([(0.0, 0.0, 1.0), (2.0, 0.0, -1.5), (4.0, 0.0, 1.0)])
    assert "dives 2.5 m below start, goal, gates and stages, to z = -1.50 m" in str(found)
    bounded = replace(LINE, environment=ab.Environment(ground=-2.0))
    told = replace(found, problem=bounded).assessment
    assert told is not None
    assert told.warnings == ()


def test_rates_beyond_common_gyroscopes_are_told_unless_the_vehicle_bounds_them() -> None:
    found = line().assessment
    assert found is not None
    fast = replace(found, max_body_rate=radians(2070.0))
    assert fast.warnings == ()  # within what the vehicle itself allows, which the certificate is about
    (warning,) = replace(fast, rate_limit=np.inf).warnings
    assert warning.startswith("turns at 2070°/s")


def test_the_room_is_the_box_that_samples_of_the_path_fill() -> None:
    found = shared_plan("flip-roll")
    assert found.assessment is not None
    positions = found.trajectory.evaluate(np.linspace(0.0, found.duration, 4001))
    np.testing.assert_allclose(found.assessment.room.lower, positions.min(axis=0), atol=1e-5)
    np.testing.assert_allclose(found.assessment.room.upper, positions.max(axis=0), atol=1e-5)
    speeds = np.linalg.norm(found.trajectory.evaluate(np.linspace(0.0, found.duration, 4001), 1), axis=-1)
    assert found.assessment.max_speed == pytest.approx(speeds.max(), rel=1e-5)
    assert found.assessment.max_tilt == pytest.approx(np.pi, abs=radians(3.0))
    assert found.assessment.asked.upper[2] == 5.5


def test_table_and_report_tell_the_assessment_and_the_table_its_warnings_in_red(tmp_path) -> None:
    found = along([(0.0, 0.0, 1.0), (2.0, 0.0, -1.5), (4.0, 0.0, 1.0)])
    found.save(tmp_path / "dive.plan")
    assert ab.load_plan(tmp_path / "dive.plan").assessment == found.assessment
    console = Console(width=200, force_terminal=True, color_system="standard")
    with console.capture() as capture:
        console.print(table(Report(found)))
    assert "\x1b[31mdives 2.5 m below" in capture.get()
    told = plain(Report(found))["plan"]["assessment"]
    assert told["lowest_m"] == pytest.approx(-1.5, abs=0.05)
    assert told["ratio"] > 1.0
    assert told["second_opinion"] is None
    assert "dives" in told["warnings"][0]


def test_a_report_tells_how_near_a_plan_is_to_what_is_possible() -> None:
    told = plain(Report(line()))["plan"]["assessment"]
    assert told["sentence"].startswith(f"at most {told['ratio']:.2f} times the shortest possible")


@pytest.mark.slow
def test_equal_rows_of_a_comparison_say_so() -> None:
    planner = ab.Miqp(intervals=8)
    first, second = ab.compare(LINE, QUAD, [("one", planner), ("two", planner)]).entries
    assert (first.note, second.note) == ("", "the same path as one's")


def test_free_knots_say_that_they_return_the_plan_that_they_began_from() -> None:
    """Two segments are slower than the eight that they begin from."""
    start = line()
    found = ab.plan(LINE, ab.FreeKnots(segments=2, start=start), QUAD)
    assert found.duration <= start.duration
    assert "none better than the path that it began from, miqp's" in str(found)


def with_rotors_of(max_thrust: float) -> ab.Vehicle:
    return replace(QUAD, rotors=tuple(replace(r, max_thrust=max_thrust) for r in QUAD.rotors))


@pytest.mark.slow
def test_a_vehicle_too_weak_for_a_flip_is_advised_nothing_that_was_not_followed() -> None:
    """To move the gate nearer, for one."""
    with pytest.raises(ab.Infeasible) as refusal:
        ab.plan(ab.load_problem("flip-roll"), ab.Miqp(intervals=12, rescue=False), with_rotors_of(2.2))
    assert "stronger" not in str(refusal.value)
    assert "gate" not in str(refusal.value)


@pytest.mark.parametrize("thrust", [-3e-3, -1e-5, 1e-4])
@pytest.mark.parametrize("short", [2e-3, 4e-9, 0.3])
def test_no_shortfall_of_a_rotor_reads_as_nothing(thrust: float, short: float) -> None:
    told = str(RotorMargin(thrust, 0.1, 0, 3.92, 0.2, 1, -short, 1.0))
    assert "-0.00 " not in told
    assert " 0.00 N too little" not in told
    assert f"{short:.2g}" in told or f"{short:.2f}" in told


def test_a_page_tells_warnings_in_red_and_nothing_else_on_it_is_red() -> None:
    """But what rotors do beyond their limits: there are none such here."""
    far = along([(0.0, 0.0, 1.0), (2.0, 400.0, 1.3), (4.0, 0.0, 1.0)], 60.0)
    near = along([(0.0, 0.0, 1.0), (2.0, 0.4, 1.3), (4.0, 0.0, 1.0)])
    for found, warnings in ((far, 1), (near, 0)):
        figure = report_figure(found, QUAD)
        said = [text.get_text() for text in figure.texts if text.get_color() == RED]
        assert len(said) == warnings
        lines = [line for axes in figure.axes for line in axes.lines]
        assert RED not in [line.get_color() for line in lines]


def test_a_way_around_obstacles_is_not_called_slow_beside_a_bound_that_knows_none() -> None:
    found = line().assessment
    assert found is not None
    slow = replace(found, duration=5.0 * found.least_duration)
    around = replace(slow, obstructed=True)
    assert (slow.suspicious, around.suspicious) == (True, False)
    assert "if nothing stood in the way" in around.sentence
    assert "stood in the way" not in slow.sentence
