"""Flights that are scored as they are flown: the same scores, and nothing kept."""

import subprocess
import sys
from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from aerobat.errors import SpecError
from aerobat.evaluation import score, score_flights
from aerobat.planning import Miqp, Plan, plan
from aerobat.problem import load_problem
from aerobat.simulation import Flight, Outcome, fly
from aerobat.states import BodyState
from aerobat.vehicle import Vehicle
from places import SUPPORT
from score_cases import QUAD, assert_same, near
from shared_plans import shared_plan

SLOW = tuple(pytest.param(name, marks=pytest.mark.slow) for name in ("floats", "jax"))


@pytest.fixture(scope="module")
def flip() -> Plan:
    return shared_plan("flip-roll")


def dispersed(count: int, spread: float = 0.03) -> list[Vehicle]:
    rng = np.random.default_rng(1)

    def alike(vehicle: Vehicle, k: int) -> Vehicle:
        thrust, mass, inertia = 1.0 + spread * rng.normal(size=3)
        rotors = tuple(replace(r, max_thrust=r.max_thrust * thrust) for r in vehicle.rotors)
        return replace(
            vehicle,
            name=f"no. {k}",
            mass=mass * vehicle.mass,
            inertia=inertia * vehicle.inertia,
            rotors=rotors,
        )

    return [alike(QUAD, k) for k in range(count)]


def fallen(count: int) -> BodyState:
    """All start at the origin; the last falls out of the sky, upside down."""
    at, velocity, q = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 4))
    q[:, 0] = 1.0
    velocity[-1], q[-1] = [0.0, 0.0, -40.0], [0.0, 1.0, 0.0, 0.0]
    return BodyState(at, velocity, q, at)


@cache
def logged(count: int) -> Flight:
    return fly(
        shared_plan("flip-roll"), dispersed(count), start=fallen(count), nominal=QUAD, engine="compiled"
    )


@pytest.mark.parametrize("engine", ["compiled", *SLOW])
def test_scores_are_those_of_the_logged_flights_also_where_one_diverges(engine: str, flip: Plan) -> None:
    count = 2 if engine == "floats" else 4
    flights = logged(count)
    scores = score_flights(flip, dispersed(count), start=fallen(count), nominal=QUAD, engine=engine)
    for k, vehicle in enumerate(dispersed(count)):
        assert_same(scores[k], score(flights[k], flip, vehicle), 1e-9)
    assert scores[count - 1].outcome is flights[count - 1].outcome is Outcome.DIVERGED
    assert scores[count - 1].sentence == flights[count - 1].sentences[0]
    assert scores.outcomes == (*[Outcome.THROUGH_GATES] * (count - 1), Outcome.DIVERGED)


def test_a_flight_without_a_gate_is_scored_by_its_errors_alone() -> None:
    line = shared_plan("line")
    (alone,) = score_flights(line)
    assert_same(alone, score(fly(line), line, QUAD), 1e-12)
    assert alone.passages == ()


FLEET = """
from score_cases import *
from aerobat.evaluation import score_flights
from aerobat.planning import plan
from aerobat.problem import load_problem

flip = plan(load_problem("flip-roll"), vehicle=QUAD)
options = {"conditions": "lab", "seed": 3, "engine": "compiled"}
scores = score_flights(flip, flights=3_000, **options)
peak = next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM"))
assert len(scores) == 3_000
for k in range(0, 3_000, 500):
    (alone,) = score_flights(flip, flights=range(k, k + 1), **options)
    assert_same(scores[k], alone, 0.0)
print(peak)
"""


@pytest.mark.slow
@pytest.mark.process
def test_thousands_of_flights_under_conditions_take_little_memory_and_are_what_each_is_alone() -> None:
    done = subprocess.run(
        [sys.executable, "-c", FLEET], cwd=SUPPORT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) < 500_000  # kB, the libraries included


@pytest.mark.slow
def test_scores_do_not_depend_on_what_flies_beside(flip: Plan) -> None:
    """To the last bit, whatever the size of the batch."""
    vehicles = dispersed(21)
    scores = score_flights(flip, vehicles, nominal=QUAD, engine="compiled")
    for count in (1, 3, 20):
        fewer = score_flights(flip, vehicles[:count], nominal=QUAD, engine="compiled")
        for k in range(count):
            assert_same(fewer[k], scores[k], 0.0)


@pytest.mark.parametrize("engine", ["floats", "compiled"])
def test_a_slower_log_is_part_of_the_full_one(engine: str, flip: Plan) -> None:
    full = fly(flip, [QUAD] * 2, engine=engine)
    slow = fly(flip, [QUAD] * 2, engine=engine, log_rate=62.5)
    rows = np.searchsorted(full.times, slow.times)
    np.testing.assert_array_equal(rows[:-1], 8 * np.arange(len(rows) - 1))
    assert slow.times[-1] == full.times[-1]
    np.testing.assert_array_equal(slow.states.position, full.states.position[:, rows])
    np.testing.assert_array_equal(slow.setpoint.q_world_body, full.setpoint.q_world_body[rows])


@pytest.mark.parametrize("log_rate", [0.0, -1.0, np.nan, 1000.0, 333.0])
def test_a_log_that_does_not_fit_the_rate_is_refused(log_rate: float, flip: Plan) -> None:
    wanted = r"(500 1/s over a whole number|0.001 or more|a finite number), got"
    with pytest.raises(SpecError, match=rf"^FlightConfig\.log_rate must be {wanted}"):
        fly(flip, QUAD, log_rate=log_rate)
    with pytest.raises(SpecError, match="a scored flight keeps no rows"):
        score_flights(flip, QUAD, log_rate=500.0)


def test_shares_of_outcomes_are_counted(flip: Plan) -> None:
    """Ever larger errors of the start: all pass, some miss, some hit the frame, some are lost."""
    scores = score_flights(flip, [QUAD] * 60, start=near(60, 1.0), engine="compiled")
    counts = Counter(scores.outcomes)
    assert sum(counts.values()) == len(scores) == 60
    assert len(counts) > 1
    assert counts[Outcome.DIVERGED] == np.isfinite(scores.stop).sum()
    passage = scores.passages[0]
    through = passage.inside & ~(passage.clearance < 0) & np.isnan(scores.stop)
    tilted = passage.attitude_error_deg > passage.attitude_tolerance_deg
    astray = counts[Outcome.MISSED_WAYPOINT] + counts[Outcome.MISSED_ATTITUDE]
    assert counts[Outcome.THROUGH_GATES] + astray == (through & ~tilted).sum()
    assert counts[Outcome.WRONG_ATTITUDE] == (through & tilted).sum() > 0
    with pytest.raises(ValueError, match="read-only"):
        scores.max_position_error_m[0] = 0.0


@pytest.mark.slow
def test_both_gates_of_two_flips_are_judged() -> None:
    found = plan(load_problem("examples/two-flips.toml"), Miqp(order=4, intervals=20), QUAD)
    result = score(fly(found), found, QUAD)
    assert [passage.gate for passage in result.passages] == ["first", "second"]
    assert all(passage.inside for passage in result.passages)
    assert result.outcome is Outcome.THROUGH_GATES
    assert result.sentence.startswith("through both gates")
    (scored,) = score_flights(found)
    assert_same(scored, result, 1e-9)
