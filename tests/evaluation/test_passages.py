"""A gate is passed where its plane is crossed, in its direction, about when that was planned; else missed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import aerobat as ab
from aerobat import so3
from aerobat.arrays import Array
from aerobat.problem.condition import Attitude
from aerobat.problem.planned_passage import PASSAGE_DEPTH
from aerobat.simulation import Outcome
from gate_motions import CRUISE, SPEED
from score_cases import QUAD, assert_same
from score_cases import near as starts_near
from shared_plans import shared_plan

AT = np.array([4.0, 0.0, 1.0])  # where the gate is
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def cruise() -> ab.Flight:
    return ab.fly(CRUISE, QUAD)


def through(gate: ab.Gate, attitude: Attitude | None = None) -> ab.Problem:
    """A problem whose one stage passes the gate."""
    stage = ab.Stage("gate", gate=gate.name, attitude=attitude)
    ends = ab.at_rest((0, 0, 1)), ab.at_rest((8, 0, 1))
    return ab.Problem("cruise", *ends, ab.CustomManeuver((stage,)), (gate,))


def gate(heading_deg: float = 0.0, **fields: float) -> ab.Gate:
    return ab.tilted_gate(AT, heading=np.deg2rad(heading_deg), **{"width": 1.4, "height": 1.0, **fields})


def moved(
    flight: ab.Flight, change: Callable[[Array], Array], turn: tuple[float, ...] = (0, 0, 0)
) -> ab.Flight:
    """The same flight with other positions, turned by `turn` [rad, body axes]."""
    q = so3.multiply(flight.states.q_world_body, so3.exp(np.array(turn, dtype=float)))
    changed = {"position": change(flight.states.position), "q_world_body": q}
    return replace(flight, series={**flight.series, **changed})


def along_x(change: Callable[[Array], Array]) -> Callable[[Array], Array]:
    return lambda p: np.column_stack([change(p[:, 0]), p[:, 1:]])


@pytest.mark.parametrize("ahead", [-0.9, -0.3, 0.0, 0.3, 0.9])
def test_a_flight_early_or_late_crosses_where_it_crosses(cruise: ab.Flight, ahead: float) -> None:
    shifted = moved(cruise, lambda p: p + np.array([ahead, -0.06, 0.08]))
    (passage,) = ab.score(shifted, through(gate()), QUAD).passages
    assert passage.time == pytest.approx(1.0 - ahead / SPEED, abs=1e-3)
    assert passage.miss == pytest.approx(0.1, abs=1e-4)
    assert passage.inside
    assert passage.planned == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize("tilt_deg", [0.0, 40.0, 90.0, 180.0])
def test_where_a_gate_is_crossed_is_told_in_its_own_axes(cruise: ab.Flight, tilt_deg: float) -> None:
    turned = gate().tilted(np.deg2rad(tilt_deg))
    shifted = moved(cruise, lambda p: p + 0.3 * turned.lateral - 0.1 * turned.up)
    (passage,) = ab.score(shifted, through(turned), QUAD).passages
    assert (passage.lateral, passage.up) == pytest.approx((0.3, -0.1), abs=1e-4)
    assert passage.miss == pytest.approx(np.hypot(passage.lateral, passage.up), rel=1e-9)


@pytest.mark.parametrize(
    ("x", "outcome", "sentence"),
    [
        (lambda x: 8.0 - x, Outcome.BACKWARDS, "crossed its plane backwards at 1.00 s"),
        (lambda x: 3.9 - np.abs(x - 3.9), Outcome.SHORT_OF_GATE, "0.10 m short of its plane about 1.00 s"),
        (lambda x: np.minimum(x, 4.0), Outcome.SHORT_OF_GATE, "0.00 m short of its plane"),
        (lambda x: 4.02 - np.abs(x - 4.02), Outcome.STOPPED_IN_GATE, "cm beyond its plane about 1.00 s"),
        (lambda x: np.minimum(x, 4.02), Outcome.STOPPED_IN_GATE, "2.0 cm beyond its plane"),
        (lambda x: x + 2.0, Outcome.EARLY, "1.00 m or more beyond its plane about 1.00 s"),
        (lambda x: x - 2.0, Outcome.SHORT_OF_GATE, "1.00 m short of its plane about 1.00 s"),
    ],
    ids=["backwards", "turned back", "stopped at it", "turned in it", "stopped in it", "early", "late"],
)
def test_what_does_not_cross_the_plane_in_its_direction_has_missed_the_gate_and_says_what_it_did(
    cruise: ab.Flight, x: Callable[[Array], Array], outcome: Outcome, sentence: str
) -> None:
    result = ab.score(moved(cruise, along_x(x)), through(gate()), QUAD)
    assert result.outcome is outcome
    assert sentence in result.sentence
    assert not result.passages[0].inside
    assert np.isnan(result.passages[0].time)


def test_a_flight_beside_the_opening_crosses_its_plane_and_misses_it(cruise: ab.Flight) -> None:
    result = ab.score(moved(cruise, lambda p: p + np.array([0.0, 3.1, 0.0])), through(gate()), QUAD)
    assert result.outcome is Outcome.MISSED_GATE
    assert result.sentence.startswith("missed the gate, 3.10 m off its centre at 1.00 s")
    assert result.passages[0].time == pytest.approx(1.0, abs=1e-3)


def test_an_oblique_path_is_judged_where_it_crosses_the_gate_s_own_plane(cruise: ab.Flight) -> None:
    """Passed beside the centre by 0.2 m, a plane turned by 40° is met 0.2 m / cos 40° from it."""
    shifted = moved(cruise, lambda p: p + np.array([0.0, 0.2, 0.0]))
    (passage,) = ab.score(shifted, through(gate(40.0)), QUAD).passages
    assert passage.miss == pytest.approx(0.2 / np.cos(np.deg2rad(40.0)), abs=1e-4)
    assert passage.time == pytest.approx(1.0 - 0.2 * np.tan(np.deg2rad(40.0)) / SPEED, abs=1e-4)
    assert passage.inside


def test_a_path_along_the_plane_passes_no_gate(cruise: ab.Flight) -> None:
    result = ab.score(cruise, through(gate(90.0)), QUAD)
    assert result.outcome in (Outcome.SHORT_OF_GATE, Outcome.STOPPED_IN_GATE)


def test_a_crossing_counts_once_it_is_well_beyond(cruise: ab.Flight) -> None:
    for stop, passed in ((0.9 * PASSAGE_DEPTH, False), (1.1 * PASSAGE_DEPTH, True)):
        held = moved(cruise, along_x(lambda x, stop=stop: np.minimum(x, AT[0] + stop)))
        assert np.isfinite(ab.score(held, through(gate()), QUAD).passages[0].time) == passed


def test_the_crossing_next_to_the_planned_instant_counts(cruise: ab.Flight) -> None:
    """Through early, back over the frame, and through once more."""
    again = moved(cruise, along_x(lambda x: x + 0.8 * np.sin((x - 4.0) * 3.0)))
    (passage,) = ab.score(again, through(gate()), QUAD).passages
    assert passage.time == pytest.approx(1.0, abs=1e-3)


def test_the_attitude_in_the_gate_is_judged_where_a_stage_asks_it(cruise: ab.Flight) -> None:
    tilted = moved(cruise, lambda p: p, turn=(0.2, 0.0, 0.0))
    asked = ab.score(tilted, through(gate(), Attitude(UP, min_thrust=5.0)), QUAD)
    assert asked.outcome is Outcome.WRONG_ATTITUDE
    assert asked.sentence == ("passed the gate 11.5° off the attitude asked at 1.00 s, 5° allowed")
    wide = replace(gate(), attitude_tolerance=0.21)
    assert (
        ab.score(tilted, through(wide, Attitude(UP, min_thrust=5.0)), QUAD).outcome is Outcome.THROUGH_GATES
    )
    free = ab.score(tilted, through(gate()), QUAD)
    assert free.outcome is Outcome.THROUGH_GATES
    assert np.isinf(free.passages[0].attitude_tolerance_deg)
    assert free.passages[0].attitude_error_deg == pytest.approx(np.rad2deg(0.2), abs=0.01)


def test_a_plan_that_turns_the_vehicle_in_the_gate_is_told_so_by_its_flight() -> None:
    """The half-flip as it was asked by half, thrust along the passage free, its goal far away."""
    half_flip = replace(ab.load_problem("half-flip"), goal=ab.at_rest((15.0, 0.0, 0.0)))
    by_half = ab.HalfFlip(passage=ab.GatePassage(upright=False))
    planned = ab.plan(replace(half_flip, maneuver=by_half), vehicle=None)
    flight = ab.fly(planned, QUAD)
    result = ab.score(flight, replace(planned, problem=half_flip))
    assert result.passages[0].attitude_error_deg > 20.0
    assert result.outcome is Outcome.WRONG_ATTITUDE
    assert ab.score(flight, planned).outcome is Outcome.THROUGH_GATES  # as nothing was asked


def test_a_flight_to_its_end_names_its_largest_error(cruise: ab.Flight) -> None:
    off = moved(cruise, lambda p: p + np.array([0.0, 0.03, 0.04]))
    bare = replace(through(gate()), maneuver=ab.Line(), gates=())
    assert ab.score(off, bare).sentence == "flown to the end, 5.00 cm off its path at most, 10.00 cm allowed"
    assert ab.score(off, through(gate()), QUAD).sentence.endswith(", 5.00 cm off its path at most")
    assert cruise.sentences[0].startswith("flown to the end, 0.")


def eased(*xs: float) -> ab.Trajectory:
    """From each x to the next in 1 s, at rest in between, quintic."""
    s = np.array([0.0, 0, 0, 10, -15, 6])
    ends = np.array([[x, 0.0, 1.0] for x in xs])
    coefficients = s[None, :, None] * np.diff(ends, axis=0)[:, None, :]
    coefficients[:, 0] += ends[:-1]
    return ab.Trajectory(np.ones(len(xs) - 1), coefficients)


PATHS = {
    "through": eased(2.0, 6.0),
    "backwards": eased(6.0, 2.0),
    "stopped in it": eased(2.0, 4.02, 4.02),
    "turned back": eased(2.0, 3.9, 2.0),
    "hesitant": eased(2.0, 4.02, 6.0),
    "twice": eased(2.0, 4.3, 3.7, 6.0),
}


@pytest.mark.parametrize(
    ("path", "engine"),
    [
        *((path, "compiled") for path in PATHS),
        ("twice", "compiled"),
        pytest.param("twice", "floats", marks=pytest.mark.slow),
    ],
)
def test_passages_are_the_same_from_a_log_and_as_they_are_flown(path: str, engine: str) -> None:
    problem = through(gate(20.0), Attitude(UP, min_thrust=5.0))
    scored = ab.score_flights(PATHS[path], QUAD, problem=problem, engine=engine)
    assert_same(scored[0], ab.score(ab.fly(PATHS[path], QUAD), problem, QUAD), 1e-9)


@pytest.mark.slow
def test_flights_that_end_in_any_way_are_scored_alike() -> None:
    flip = shared_plan("flip-roll-translation")
    starts = starts_near(30, 1.5)
    logged = ab.fly(flip, start=starts, engine="compiled")
    scores = ab.score_flights(flip, start=starts, engine="compiled")
    for k, score in enumerate(scores):
        assert_same(score, ab.score(logged[k], flip, QUAD), 1e-9)
    assert len(set(scores.outcomes)) > 2
