"""Courses judged whole: every passage of every lap, waypoints too, and the laps' times."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import aerobat as ab
from aerobat.reporting.plain_data import plain
from aerobat.reporting.report import Report
from aerobat.simulation.passages.stages import MISS_TOLERANCE

RED = ab.tilted_gate((3.0, 0.0, 1.0), 0.0, width=2.0, height=2.0, name="red")
BACK = ab.tilted_gate((3.0, 4.0, 2.0), np.pi, width=2.0, height=2.0, name="back")
ENDS = ab.at_rest((0.0, 0.0, 1.0)), ab.at_rest((0.0, 4.0, 1.0))
LAP = (ab.PassGate("red"), ab.PassWaypoint((6.0, 2.0, 1.5), radius=0.3), ab.PassGate("back"))
COURSE = ab.Problem(
    "two laps", *ENDS, ab.Course((*LAP, ab.PassWaypoint((0.0, 2.0, 1.0), radius=0.2)), 2, 3), (RED, BACK)
)


@cache
def planned() -> ab.Plan:
    """A plan of two laps."""
    return ab.plan(COURSE, "min-snap", "agile-quad")


@cache
def flown() -> ab.Flight:
    """Its flight."""
    return ab.fly(planned(), rate=200.0)


def test_every_passage_of_every_lap_is_scored_in_the_order_of_the_course() -> None:
    score = ab.score(flown(), planned())
    assert score.outcome.is_success, score.sentence
    assert [(p.gate, p.lap) for p in score.passages] == [("red", 1), ("back", 1), ("red", 2), ("back", 2)]
    assert [(w.waypoint, w.lap) for w in score.waypoints] == [
        ("waypoint 1", 1),
        ("waypoint 2", 1),
        ("waypoint 1", 2),
    ]
    times = [stage.time for stage in planned().stages]
    passed = sorted(each.time for each in (*score.passages, *score.waypoints))
    assert passed == pytest.approx(times, abs=0.05)
    assert all(waypoint.miss <= waypoint.radius + MISS_TOLERANCE for waypoint in score.waypoints)


def test_laps_end_with_their_last_passage_and_add_up() -> None:
    score = ab.score(flown(), planned())
    first, second = score.laps
    assert (first.end, second.end) == (score.waypoints[1].time, score.passages[3].time)
    assert first.duration + second.duration == pytest.approx(second.end)
    facts = plain(Report(planned(), score))["flight"]["laps"]
    assert facts == [vars(first), vars(second)]


def test_a_problem_alone_finds_the_passages_of_all_laps() -> None:
    """The set-points' nearest approaches in the order of the stages, not the nearest of all."""
    by_plan, by_problem = ab.score(flown(), planned()), ab.score(flown(), COURSE, "agile-quad")
    assert [p.time for p in by_problem.passages] == [p.time for p in by_plan.passages]
    assert [w.miss for w in by_problem.waypoints] == [w.miss for w in by_plan.waypoints]


def test_flights_that_are_not_logged_are_judged_alike() -> None:
    """By the kernel, tick by tick, as by the rows of a log."""
    (added_up,) = ab.score_flights(planned(), rate=200.0)
    logged = ab.score(flown(), planned())
    for one, other in zip(added_up.waypoints, logged.waypoints, strict=True):
        assert (one.waypoint, one.lap) == (other.waypoint, other.lap)
        assert [one.time, one.miss, one.speed] == pytest.approx(
            [other.time, other.miss, other.speed], abs=1e-6
        )
    assert added_up.outcome is logged.outcome
    assert len(added_up.laps) == len(logged.laps) == 2


@pytest.mark.parametrize("off", [0.5, 0.9])
def test_a_flight_that_misses_a_waypoint_is_told_by_how_much(off: float) -> None:
    """The miss is the distance of its nearest approach, found anew here from its rows."""
    place = np.array([6.0 + off, 2.0, 1.5])
    elements = list(COURSE.maneuver.elements)
    elements[1] = ab.PassWaypoint(place, radius=0.05)
    moved = replace(
        planned(), problem=replace(COURSE, maneuver=replace(COURSE.maneuver, elements=tuple(elements)))
    )
    for score in (ab.score(flown(), moved), next(iter(ab.score_flights(moved, rate=200.0)))):
        missed = score.waypoints[0]
        near = np.abs(flown().times - missed.planned) <= 0.25
        nearest = np.linalg.norm(flown().states.position[near] - place, axis=-1).min()
        assert missed.miss == pytest.approx(nearest, abs=1e-3)
        assert score.outcome is ab.Outcome.MISSED_WAYPOINT
        assert score.sentence.startswith(
            f"missed waypoint 1, {missed.miss:.3f} m from it at {missed.time:.2f} s"
        )


def test_scores_of_many_flights_have_a_column_for_every_passage() -> None:
    pytest.importorskip("pandas")
    table = ab.to_dataframe(ab.score_flights(planned(), rate=200.0))
    times = [name for name in table.columns if name.endswith("_time") and "closest" not in name]
    assert len([name for name in times if "backward" not in name]) == 8  # and the goal
