"""The planner that is taken where nobody names one."""

from dataclasses import replace

import pytest

import aerobat as ab
from aerobat.planning import planner_for, suited_planner

QUAD = ab.load_vehicle("agile-quad")


@pytest.mark.parametrize(
    ("name", "planner"),
    [
        ("line", "miqp"),
        ("flip-roll", "miqp"),
        ("section-v", "miqp"),
        ("race-7", "free-knots"),
        ("power-loop", "miqp"),
    ],
)
def test_long_courses_are_free_knots_and_the_rest_is_searched_exactly(name: str, planner: str) -> None:
    assert suited_planner(ab.load_problem(name), QUAD) == planner
    assert suited_planner(ab.load_problem(name), None) == "miqp"


def test_options_of_the_usual_planner_bring_it_back(tmp_path, capsys) -> None:
    """`--order` is the MIQP's: a course of six points on a line."""
    points = tuple(ab.Waypoint(position=(x, 0.0, 1.0), radius=0.3) for x in range(1, 7))
    course = ab.Problem("six", ab.at_rest((0, 0, 1)), ab.at_rest((7, 0, 1)), ab.Waypoints(points))
    file = tmp_path / "six.toml"
    ab.write_problem(course, file)
    assert suited_planner(course, QUAD) == "free-knots"
    from aerobat.cli.options import PlanningOptions
    from aerobat.cli.tasks import make_planner

    assert make_planner(PlanningOptions(), course, QUAD) == planner_for(course, QUAD)
    flown = {"reserve": 0.15, "clearance": 0.1}  # what is planned is to be flown
    assert planner_for(course, QUAD) == ab.FreeKnots(**flown)
    assert make_planner(replace(PlanningOptions(), order=4), course, QUAD) == ab.Miqp(order=4, **flown)
    assert make_planner(replace(PlanningOptions(), planner="miqp"), course, QUAD).kind == "miqp"
