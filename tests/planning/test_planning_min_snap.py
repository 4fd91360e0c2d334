"""The closed-form planner: the paper's Section V-D as printed, and what it does on other problems."""

from typing import Any

import numpy as np
import pytest

from aerobat.errors import Infeasible, SpecError
from aerobat.flatness import reference
from aerobat.planning import MinSnap, Plan, TimeScaling, plan
from aerobat.problem import (
    Condition,
    CustomManeuver,
    GatePassage,
    Line,
    Problem,
    Stage,
    Waypoint,
    Waypoints,
    at_rest,
    load_problem,
    tilted_gate,
)
from aerobat.states import STANDARD_GRAVITY
from aerobat.trajectory import Trajectory
from aerobat.trajectory.minimum_effort import minimum_effort
from aerobat.vehicle import load_vehicle
from shared_plans import closed_form


@pytest.fixture(scope="module")
def paper() -> Plan:
    return plan(load_problem("section-v"), MinSnap(), load_vehicle("section-v"))


def test_the_papers_search_is_feasible_at_its_twelfth_iteration(paper: Plan) -> None:
    """Fig. 9: t1 = 1.6 s, t2 = 3.1 s, after 12 iterations that shift both knots by 0.1 s."""
    assert [a.duration for a in paper.attempts] == pytest.approx(2.0 + 0.1 * np.arange(12))
    assert [a.feasible for a in paper.attempts] == [False] * 11 + [True]
    assert paper.trajectory.knots == pytest.approx([0.0, 1.6, 3.1])
    assert paper.certificate is not None
    assert paper.certificate.certified
    assert paper.status == "feasible"


def test_stopped_at_the_papers_sixth_iteration_it_asks_more_than_the_rotors_have(paper: Plan) -> None:
    """Fig. 10: t1 = 1.0 s, t2 = 2.5 s; rotors from -11.7 to 15.0 N."""
    early = plan(load_problem("section-v"), MinSnap(stop_after=6), load_vehicle("section-v"))
    assert early.trajectory.knots == pytest.approx([0.0, 1.0, 2.5])
    assert early.status == "stopped"
    assert early.certificate is not None
    assert not early.certificate.certified
    assert early.margin is not None
    assert (early.margin.min_thrust, early.margin.max_thrust) == pytest.approx((-11.7, 15.0), abs=0.05)
    assert [a.outcome for a in early.attempts] == [a.outcome for a in paper.attempts[:6]]


def test_without_a_vehicle_the_waypoints_own_times_are_taken() -> None:
    assert plan(load_problem("section-v"), MinSnap(), vehicle=None).trajectory.knots == pytest.approx(
        [0.0, 0.5, 2.0]
    )


def test_a_longer_search_of_the_papers_kind_lengthens_the_first_segment_only(paper: Plan) -> None:
    vehicle = load_vehicle("section-v")
    first = plan(load_problem("section-v"), MinSnap(time_scaling=TimeScaling.FIRST, stop_after=3), vehicle)
    every = plan(load_problem("section-v"), MinSnap(time_scaling=TimeScaling.ALL, stop_after=3), vehicle)
    assert first.trajectory.durations == pytest.approx([0.7, 1.5])
    assert every.trajectory.durations == pytest.approx([0.55, 1.65])


@pytest.mark.parametrize("order", [3, 4, 5])
def test_a_path_through_waypoints_meets_them_all_and_is_certified(order: int) -> None:
    """Components, velocities and attitudes as given, whatever is least: jerk, snap or crackle."""
    waypoints = (
        Waypoint(position=(2.0, np.nan, 1.0), velocity=(np.nan, 0.0, np.nan)),
        Waypoint(position=(4.0, 1.0, 1.5), up=(1.0, 0.0, 1.0), thrust=15.0),
        Waypoint(position=(6.0, 0.0, np.nan), acceleration=(0.0, np.nan, np.nan)),
    )
    problem = Problem("slalom", at_rest((0, 0, 1)), at_rest((8, 0, 1)), Waypoints(waypoints))
    vehicle = load_vehicle("agile-quad")
    if order == 3:  # jerk jumps at the knots, and body rates with it: no moment can do that
        with pytest.raises(Infeasible, match="closed-form"):
            plan(problem, MinSnap(order), vehicle)
        return
    found = plan(problem, MinSnap(order), vehicle)
    assert found.certificate is not None
    assert found.certificate.certified
    p, v, a = (found.trajectory.evaluate(found.trajectory.knots, k) for k in range(3))
    for knot, waypoint in enumerate(waypoints, 1):
        for values, given in ((p, waypoint.position), (v, waypoint.velocity), (a, waypoint.acceleration)):
            told = ~np.isnan(given)
            np.testing.assert_allclose(values[knot][told], given[told], atol=1e-9)
    thrust = a[2] + [0.0, 0.0, STANDARD_GRAVITY]
    np.testing.assert_allclose(thrust, 15.0 * np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0), atol=1e-9)


def test_a_gate_is_passed_with_its_attitude() -> None:
    found, vehicle = closed_form(), load_vehicle("agile-quad")
    (stage,) = found.stages
    gate = found.problem.gate(stage.gate)
    setpoint = reference(found.trajectory, vehicle, times=[stage.time]).setpoint
    np.testing.assert_allclose(setpoint.flat.position[0], gate.position, atol=1e-9)
    thrust = setpoint.flat.acceleration[0] + [0.0, 0.0, STANDARD_GRAVITY]
    np.testing.assert_allclose(thrust / np.linalg.norm(thrust), gate.up, atol=1e-9)


def test_what_the_closed_form_cannot_see_is_checked_and_told() -> None:
    """It knows no inequality: a detour that is asked by one is missed, in a sentence."""
    aside = Stage("aside", (Condition("position", np.array([0.0, 1.0, 0.0]), lower=2.0),))
    problem = Problem("aside", at_rest(np.zeros(3)), at_rest((5.0, 0.0, 0.0)), CustomManeuver((aside,)))
    with pytest.raises(
        Infeasible, match=r"'aside' asks position along \(0, 1, 0\) of 2 or more, the closed form gives"
    ) as error:
        plan(problem, MinSnap(), load_vehicle("agile-quad"))
    assert error.value.attempts


@pytest.mark.parametrize("wrong", [{"order": 6}, {"stop_after": 0}])
def test_settings_that_mean_nothing_are_refused(wrong: dict[str, int]) -> None:
    with pytest.raises(SpecError, match=next(iter(wrong))):
        MinSnap(**wrong)


def test_a_gate_is_passed_as_fast_as_its_passage_asks() -> None:
    gate = tilted_gate((2.0, 0.5, 1.0), heading=0.6)  # oblique: its velocities across fix all components
    problem = Problem("oblique", at_rest((0.0, 0.0, 1.0)), at_rest((4.0, 2.0, 1.0)), Line(), (gate,))
    found = plan(problem, MinSnap(), load_vehicle("agile-quad"))
    passing = found.trajectory.evaluate(found.stages[0].time, 1)
    assert passing @ gate.normal >= GatePassage().speed - 1e-6
    assert found.certified


def test_the_drag_at_waypoints_that_fix_positions_alone_costs_no_closed_form(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Three for each waypoint and attempt made three hundred waypoints take minutes."""
    solved: list[int] = []

    def counted(fixed: Any, *settings: Any) -> Trajectory:
        solved.append(len(fixed))
        return minimum_effort(fixed, *settings)

    monkeypatch.setattr("aerobat.planning.polynomial.min_snap.minimum_effort", counted)
    waypoints = tuple(Waypoint(position=(2.0 * k, (-1.0) ** k, 1.5)) for k in range(1, 6))
    problem = Problem(
        name="row",
        start=at_rest((0.0, 0.0, 1.5)),
        goal=at_rest((12.0, 0.0, 1.5)),
        maneuver=Waypoints(waypoints),
    )
    found = plan(problem, MinSnap(), load_vehicle("agilicious"))
    assert solved == [7] * len(found.attempts)
