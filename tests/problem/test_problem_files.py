"""Problems: from files and back, and what they refuse."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.problem import (
    Ball,
    Condition,
    CustomManeuver,
    EndState,
    HalfFlip,
    Limits,
    Line,
    Problem,
    Stage,
    Waypoint,
    Waypoints,
    at_rest,
    load_problem,
    problem_names,
    tilted_gate,
    write_problem,
)

SPELLED_OUT = Problem(
    "spelled-out",
    start=EndState((0, 0, 1), (1, 0, 0), (0, 0.5, 0)),
    goal=at_rest((3, 0, 1)),
    maneuver=CustomManeuver(
        (
            Stage("kick", (Condition("specific_thrust", (1, 0, -1), 0.0, 0.0),)),
            Stage("near", ball=Ball((1.0, 1.0, 2.0), 0.5)),
            Stage(
                "gate",
                (Condition("velocity", (1, 0, 0), lower=2.0),),
                at=0.25,
                interval_offset=1,
                gate="gate",
                crossing_point="free",
                margin=0.05,
            ),
        ),
        path_constraints=(Condition("position", (0, 0, 1), lower=0.0),),
        ordered=False,
    ),
    gates=(
        tilted_gate(np.array([1.0, 0, 2]), heading=0.3, tilt=-0.7, width=0.8, height=0.4),
        tilted_gate(np.array([2.0, 0, 2]), name="second"),
    ),
    limits=Limits(lower=(-9, -9, 0), upper=(9, 9, 9), velocity=(8, 8, 6), snap=500.0),
    heading=np.pi,
    environment=Environment(gravity=9.80665, wind=(1.0, 0.0, -0.5), ground=-1.0),
    description="every key of the format",
)


THROUGH_WAYPOINTS = replace(
    SPELLED_OUT,
    name="through-waypoints",
    maneuver=Waypoints(
        (
            Waypoint(position=(np.nan, np.nan, 2.0), velocity=(1.0, np.nan, 0.0), time=0.5),
            Waypoint(gate="second", up=(0.0, 1.0, -1.0), time=0.75),
            Waypoint(position=(1.0, 2.0, 3.0), up=(0.0, 0.0, -2.0), thrust=12.0, time=1.5),
            Waypoint(acceleration=(0.0, np.nan, -9.0), time=2.0),
            Waypoint(position=(2.0, 2.0, 3.0), radius=0.3),
            Waypoint(gate="gate", crossing_point="free", margin=0.1),
        ),
        duration=3.0,
    ),
)
PROBLEMS = [*map(load_problem, problem_names()), SPELLED_OUT, THROUGH_WAYPOINTS]


@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda p: p.name)
def test_a_problem_survives_its_file(problem: Problem, tmp_path: Path) -> None:
    write_problem(problem, tmp_path / "problem.toml")
    assert load_problem(tmp_path / "problem.toml") == problem


def test_a_file_without_a_name_is_named_after_itself(tmp_path: Path) -> None:
    path = tmp_path / "backyard.toml"
    write_problem(SPELLED_OUT, path)
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(line for line in lines if line != 'name = "spelled-out"\n'))
    assert load_problem(path) == replace(SPELLED_OUT, name="backyard")


def test_the_built_in_problems_are_the_reference_codes() -> None:
    """Gates and goals of the authors' public code."""
    names = ("flip-roll", "flip-pitch", "flip-roll-translation", "half-flip", "line", "section-v")
    gates = {name: next(iter(load_problem(name).gates), None) for name in names}
    goals = {name: load_problem(name).goal.position.tolist() for name in names}
    assert {n: None if g is None else g.position.tolist() for n, g in gates.items()} == {
        "flip-roll": [0, 0, 5.5],
        "flip-pitch": [0, 0, 5.5],
        "flip-roll-translation": [2.5, 0, 5.5],
        "half-flip": [2.5, 2, 3.5],
        "line": None,
        "section-v": None,
    }
    assert goals == {
        "flip-roll": [0, 0, 0],
        "flip-pitch": [0, 0, 0],
        "flip-roll-translation": [5, 0, 0],
        "half-flip": [5, 0, 0],
        "line": [10, 0, 0],
        "section-v": [6, 0, 0],
    }


def test_paper_mode_brings_the_reference_codes_limits() -> None:
    limits = load_problem("line").as_in_paper().limits
    assert [limits.of(d)[1].tolist() for d in (1, 2, 3)] == [[10.0] * 3, [90.0] * 3, [200.0] * 3]


@pytest.mark.parametrize("place", ["start", "goal"])
def test_an_end_outside_the_limits_is_refused_by_its_field_and_axis(place: str) -> None:
    inside = load_problem("line")
    limits = Limits(lower=(-1, -1, -1), upper=(20, 1, 1))
    with pytest.raises(SpecError, match=rf"{place}.position: its y component, 2 m.*widen"):
        replace(inside, limits=limits, **{place: at_rest((0, 2, 0))})


def test_a_start_too_fast_for_the_limits_is_refused() -> None:
    with pytest.raises(SpecError, match=r"start.velocity: its x component, 11 m/s"):
        replace(load_problem("line"), start=EndState((0, 0, 0), (11, 0, 0)))


def test_a_start_below_the_ground_is_refused_with_what_frees_it() -> None:
    """The remedy was to widen limits.upper."""
    with pytest.raises(SpecError, match=r"start\.position.* move it or lower environment\.ground$"):
        Problem("low", at_rest((0, 0, -1)), at_rest((4, 0, 1)), environment=Environment(ground=0.0))
    with pytest.raises(SpecError, match=r"move it or widen limits\.lower and limits\.upper$"):
        Problem(
            "high",
            at_rest((0, 0, 9)),
            at_rest((4, 0, 1)),
            limits=Limits(upper=(5, 5, 5)),
            environment=Environment(ground=0.0),
        )


def test_a_ground_above_the_limits_is_refused() -> None:
    with pytest.raises(SpecError, match=r"environment.ground must be below limits.upper, got 9 and 5 m"):
        replace(
            load_problem("line"),
            environment=Environment(ground=9.0),
            limits=Limits(upper=(np.inf, np.inf, 5)),
        )


def test_a_half_flip_without_a_gate_is_refused() -> None:
    with pytest.raises(SpecError, match=r"\[\[gates\]\]"):
        Problem("lost", at_rest((0, 0, 0)), at_rest((0, 0, 0)), HalfFlip())


@pytest.mark.parametrize(
    "bad", [{"velocity": 0.0}, {"jerk": -1.0}, {"snap": (1, 2)}, {"lower": (5, 5, 5), "upper": (1, 9, 9)}]
)
def test_limits_that_exclude_everything_are_refused(bad: dict) -> None:
    with pytest.raises(SpecError, match=r"Limits\."):
        Limits(**bad)


def test_a_value_is_immutable_for_real() -> None:
    source = np.zeros(3)
    problem = Problem("still", EndState(source), at_rest((1, 0, 0)), Line())
    source[:] = 7.0
    assert problem.start.position.tolist() == [0, 0, 0]
    with pytest.raises(ValueError, match="read-only"):
        problem.start.position[0] = 1.0
