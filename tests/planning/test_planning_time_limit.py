"""A limit of time holds for every planner; the clock is one that ticks when it is looked at."""

from __future__ import annotations

from dataclasses import replace
from itertools import count

import numpy as np
import pytest

from aerobat import cli
from aerobat.errors import Infeasible
from aerobat.optimization import deadline
from aerobat.planning import (
    FreeKnots,
    MinSnap,
    Miqp,
    Plan,
    Planner,
    SecondOpinion,
    TimeOptimal,
    plan,
    with_second_opinion,
)
from aerobat.planning.recorder import Progress
from aerobat.planning.second_opinion import OPINION_TIME
from aerobat.problem import load_problem
from aerobat.reporting.facts import facts
from aerobat.studies.compare import compare
from aerobat.vehicle import load_vehicle

SECTION_V, QUAD = load_problem("section-v"), load_vehicle("section-v")


@pytest.fixture(autouse=True)
def _ticking(monkeypatch: pytest.MonkeyPatch) -> None:
    """A limit of n seconds is over when it was asked for n times; what solvers get of it is theirs."""
    ticks = count()
    monkeypatch.setattr(deadline, "clock", lambda: 1000.0 * next(ticks))


def planned(planner: Planner) -> Plan | None:
    """The plan; None where none was found, which is put down to the time."""
    try:
        return plan(SECTION_V, planner, QUAD)
    except Infeasible as infeasible:
        complaint = str(infeasible)
    assert "allow more with --time-limit" in complaint
    assert "\n" not in complaint
    return None


@pytest.mark.parametrize(
    ("planner", "ticks"),
    [
        (Miqp, (0, 20, 80, 200)),
        pytest.param(Miqp, (0, 60, 150, 300, 400), marks=pytest.mark.slow),
        (MinSnap, (0, 2, 4, 7, 11, 20)),
        (FreeKnots, (0, 12, 80)),
        pytest.param(FreeKnots, (0, 12, 250, 800), marks=pytest.mark.slow),
        pytest.param(FreeKnots, (0, 400), marks=pytest.mark.slow),  # over as the last start is looked for
        pytest.param(TimeOptimal, (0, 60, 200), marks=pytest.mark.slow),
    ],
)
def test_a_limit_yields_the_best_so_far_certified_or_says_that_there_is_none(
    planner: type[Planner], ticks: tuple[int, ...]
) -> None:
    plans = [planned(planner(time_limit=1000.0 * tick)) for tick in ticks]
    assert plans[0] is None
    found = [each for each in plans if each is not None]
    assert found
    assert all(each.certified for each in found)
    first = plans.index(found[0])
    assert None not in plans[first:]  # what less time finds, more time finds,
    durations = np.array([each.duration for each in plans[first:] if each is not None])
    assert (durations <= 1.03 * np.minimum.accumulate(durations)).all()  # and hardly slower


def test_a_plan_that_a_limit_ended_says_so() -> None:
    limited = planned(Miqp(time_limit=80_000.0))
    assert limited is not None
    assert limited.status == "time_limit"


@pytest.mark.slow
def test_a_plan_in_time_is_the_same_as_without_a_limit() -> None:
    unlimited, in_time = (
        plan(SECTION_V, Miqp(intervals=12, time_limit=limit), QUAD) for limit in (None, 1e9)
    )
    assert in_time.status == unlimited.status
    assert in_time.trajectory.coefficients.tobytes() == unlimited.trajectory.coefficients.tobytes()


def test_time_optimal_without_time_for_a_path_of_its_own_returns_that_which_it_began_from() -> None:
    found = planned(TimeOptimal(time_limit=60_000.0))
    assert found is not None
    assert found.certified
    assert (found.planner, found.status) == ("time-optimal", "time_limit")
    assert found.rescue.endswith("than the path that it began from, min-snap's")


@pytest.mark.parametrize(
    ("planner", "ticks"), [pytest.param("miqp", 100, marks=pytest.mark.slow), ("min-snap", 14)]
)
def test_what_a_limit_left_of_a_comparison_says_how_far_from_the_shortest_possible_it_is(
    planner: str, ticks: int
) -> None:
    (entry,) = compare(SECTION_V, QUAD, [planner], time_limit=1000.0 * ticks).entries
    found = entry.plan
    assert found is not None
    assert found.assessment is not None
    ratio = found.duration / found.assessment.least_duration
    told = f"the best found by the time limit, at most {ratio:.2f} times the shortest possible"
    assert entry.note.startswith(told)
    if found.bound is None:  # else it is a program's own, whose cost is another
        (cost,) = (fact for fact in facts(found) if fact.key == "cost")
        assert cost.words.endswith(told)


@pytest.mark.slow
def test_what_is_left_of_a_command_s_limit_is_all_that_a_second_opinion_has(
    tmp_path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    left: list[float | None] = []

    def opinion(plan: Plan, progress: Progress | None = None) -> Plan:
        left.append(deadline.time_left())
        return plan

    monkeypatch.setattr("aerobat.cli.tasks.with_explanation", opinion)
    arguments = ["plan", "line", "--planner", "min-snap", "--time-limit", "1e9", "--json"]
    cli.main(arguments)
    assert not left  # unless it is asked for
    cli.main([*arguments, "--explain"])
    assert left[0] is not None
    assert left[0] < 1e9


def slower(found: Plan) -> Plan:
    """Four times as long as found, which is suspicious."""
    path = replace(found.trajectory, durations=4.0 * found.trajectory.durations)
    return replace(found, trajectory=path)


def test_where_nothing_is_left_of_a_limit_there_is_no_second_opinion() -> None:
    found = plan(load_problem("line"), MinSnap(), "agile-quad")
    poor = slower(found)
    with deadline.within_time(0.0):
        told = with_second_opinion(poor).assessment
    assert told is not None
    assert told.sentence.endswith("no second opinion: the time was over")


def test_a_second_opinion_ends_by_itself_where_nobody_gave_a_limit(monkeypatch) -> None:
    found = plan(load_problem("line"), MinSnap(), "agile-quad")
    poor = slower(found)
    left: list[float | None] = []

    def opinion(plan: Plan, progress: Progress | None) -> SecondOpinion:
        left.append(deadline.time_left())
        return SecondOpinion("", None)

    monkeypatch.setattr("aerobat.planning.second_opinion._second_opinion", opinion)
    with_second_opinion(poor)
    assert left[0] is not None
    assert left[0] <= OPINION_TIME
    assert deadline.time_left() is None


def test_an_inner_limit_never_outlasts_an_outer_one() -> None:
    with deadline.within_time(3000.0):
        with deadline.within_time(1e9):
            left = deadline.time_left()
            assert left is not None
            assert left <= 3000.0
            assert deadline.time_left() == 0.0  # the clock has ticked on
        assert deadline.out_of_time()
    assert deadline.time_left() is None
