"""A limit of time holds for every planner; the clock is one that ticks when it is looked at."""

from __future__ import annotations

from itertools import count

import pytest

from aerobat.errors import Infeasible
from aerobat.optimization import deadline
from aerobat.planning import FreeKnots, MinSnap, Miqp, Plan, Planner, TimeOptimal, plan
from aerobat.problem import load_problem
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
        (Miqp, (0, 2, 7, 20, 40, 60, 80, 100)),
        (MinSnap, (0, 2, 4, 7, 11, 20)),
        (FreeKnots, (0, 4, 12, 22, 50)),
        (TimeOptimal, (0, 60, 200, 300)),
    ],
)
def test_a_limit_yields_the_best_so_far_certified_or_says_that_there_is_none(
    planner: type[Planner], ticks: tuple[int, ...]
) -> None:
    if planner in (FreeKnots, TimeOptimal):
        pytest.importorskip("casadi")
    plans = [planned(planner(time_limit=1000.0 * tick)) for tick in ticks]
    assert plans[0] is None
    found = [each for each in plans if each is not None]
    assert found
    assert all(each.certified for each in found)
    first = plans.index(found[0])
    assert None not in plans[first:]  # what less time finds, more time finds,
    durations = [each.duration for each in plans[first:] if each is not None]
    assert durations == sorted(durations, reverse=True)  # and no slower


def test_a_plan_that_a_limit_ended_says_so_and_one_in_time_is_the_same_as_without() -> None:
    limited = [planned(Miqp(time_limit=1000.0 * ticks)) for ticks in (30, 50, 70)]
    assert {found.status for found in limited if found is not None} == {"time_limit"}
    unlimited, in_time = (plan(SECTION_V, Miqp(time_limit=limit), QUAD) for limit in (None, 1e9))
    assert in_time.status == unlimited.status == "locally optimal"
    assert in_time.trajectory.coefficients.tobytes() == unlimited.trajectory.coefficients.tobytes()


def test_an_inner_limit_never_outlasts_an_outer_one() -> None:
    with deadline.within_time(3000.0):
        with deadline.within_time(1e9):
            left = deadline.time_left()
            assert left is not None
            assert left <= 3000.0
            assert deadline.shorter(5.0) == 0.0  # the clock has ticked on
        assert deadline.out_of_time()
    assert deadline.time_left() is None
    assert deadline.shorter(5.0) == 5.0
