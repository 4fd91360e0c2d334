"""Flights that neither a gate nor a radius judges are judged by the problem's tolerance."""

from __future__ import annotations

from dataclasses import replace
from math import radians
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import aerobat as ab
from aerobat import so3
from aerobat.evaluation.criteria import criterion
from aerobat.planning import PlacedStage
from aerobat.problem import Tolerance
from aerobat.reporting.plain_data import plain
from aerobat.reporting.tables import table
from aerobat.simulation import Outcome
from gate_motions import CRUISE, SPEED
from looping_flights import one
from score_cases import QUAD, near

WIDE = Tolerance(position=2.0, attitude=radians(80.0))
COURSE = ab.Course(
    (ab.PassGate(gate="gate"), ab.PassWaypoint(position=(2.5 * SPEED / 2, 0.0, 1.0), up=(0.0, 0.0, 1.0)))
)


def cruising(maneuver: ab.Maneuver | None = None) -> ab.Plan:
    """A plan straight on at one height, through a gate and by a place if a course is given."""
    problem = ab.Problem(
        name="cruise",
        start=ab.at_rest((0.0, 0.0, 1.0)),
        goal=ab.at_rest((2.0 * SPEED, 0.0, 1.0)),
        maneuver=maneuver or ab.Line(),
        gates=() if maneuver is None else (ab.tilted_gate((SPEED, 0.0, 1.0)),),
    )
    stages = (PlacedStage("gate", 0, 1.0, "gate"), PlacedStage("waypoint", 1, 1.25))
    return ab.Plan(problem, CRUISE, "by hand", vehicle=QUAD, stages=stages if maneuver else ())


def moved(flight: ab.Flight, since: float, aside: float = 0.0, tilt_deg: float = 0.0) -> ab.Flight:
    """The flight with its positions moved aside [m] and its thrust axis tilted since an instant [s]."""
    late = flight.times >= since
    position = flight.states.position + np.outer(late, [0.0, aside, 0.0])
    turn = so3.exp(np.outer(late, [radians(tilt_deg), 0.0, 0.0]))
    q = so3.multiply(flight.states.q_world_body, turn)
    return replace(flight, series={**flight.series, "position": position, "q_world_body": q})


def test_a_flight_that_leaves_its_path_by_more_than_the_tolerance_did_not_go_well() -> None:
    plan = cruising()
    flight = ab.fly(plan)
    assert ab.score(flight, plan).sentence.endswith("off its path at most, 10.00 cm allowed")
    off = ab.score(moved(flight, 0.5, aside=0.3), plan)
    assert off.outcome is Outcome.OFF_PATH
    assert off.sentence == "left its path by more than 10.00 cm at 0.50 s, by 30.00 cm at most"


def test_a_key_of_the_problem_changes_the_tolerance() -> None:
    plan = cruising()
    flight = moved(ab.fly(plan), 0.5, aside=0.3)
    wide = replace(plan, problem=replace(plan.problem, tolerance=WIDE))
    assert ab.score(flight, wide).outcome is Outcome.COMPLETE
    assert ab.score(flight, wide).sentence.endswith("2.00 m allowed")


def test_stages_beside_gates_are_kept_to_the_tolerance_and_the_path_between_is_not() -> None:
    plan = cruising(COURSE)
    flight = ab.fly(plan)
    astray = moved(moved(flight, 0.4, aside=3.0), 0.6, aside=-3.0)
    assert ab.score(astray, plan).outcome is Outcome.THROUGH_GATES
    assert "missed waypoint, 0.300 m from it" in ab.score(moved(flight, 1.1, aside=0.3), plan).sentence
    assert "missed the goal, 0.300 m from it" in ab.score(moved(flight, 1.6, aside=0.3), plan).sentence
    turned = moved(moved(flight, 0.95, tilt_deg=15.0), 1.55, tilt_deg=-15.0)
    assert ab.score(turned, plan).sentence.startswith(
        "stayed 15.0° off the attitude of waypoint about 1.25 s"
    )
    wide = replace(plan, problem=replace(plan.problem, tolerance=WIDE))
    assert ab.score(moved(turned, 1.1, aside=0.3), wide).outcome is Outcome.THROUGH_GATES


@pytest.mark.parametrize(("maneuver", "tolerance"), [(None, Tolerance()), (COURSE, Tolerance(position=0.01))])
def test_flights_that_keep_no_log_are_kept_to_the_same_tolerance(
    maneuver: ab.Maneuver | None, tolerance: Tolerance
) -> None:
    plan, states = cruising(maneuver), near(6, 0.08)
    plan = replace(plan, problem=replace(plan.problem, tolerance=tolerance))
    first = [CRUISE.evaluate(0.0, derivative) for derivative in range(2)]
    starts = replace(states, position=first[0] + states.position, velocity=first[1] + states.velocity)
    scores = ab.score_flights(plan, start=starts)
    logged = [ab.score(ab.fly(plan, start=one(starts, k)), plan) for k in range(6)]
    assert [score.sentence for score in scores] == [score.sentence for score in logged]
    assert len({score.outcome for score in logged}) > 1


def test_a_sweep_says_what_its_flights_are_judged_by() -> None:
    swept = ab.sweep(cruising(), ab.Dispersion(rotor=0.05), runs=8, workers=1)
    judged = "the whole path within 10.00 cm, attitudes of stages within 10°"
    assert plain(swept)["judged_by"] == judged
    console = Console(width=200)
    with console.capture() as shown:
        console.print(table(swept))
    assert judged in shown.get()
    far = swept.table["max_position_error_m"] > 0.1
    assert (swept.table["outcome"][far] != "complete").all()


def test_a_tolerance_is_read_from_a_file_and_written_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    problem = replace(ab.load_problem("line"), tolerance=Tolerance(0.3, radians(20.0)))
    ab.write_problem(problem, path)
    assert "[tolerance]\nattitude_deg = 20.0\nposition = 0.3\n" in path.read_text()
    assert ab.load_problem(path).tolerance == problem.tolerance
    path.write_text(path.read_text().replace("position = 0.3", "position = -1"))
    with pytest.raises(ab.SpecError, match=r"tolerance\.position must be"):
        ab.load_problem(path)


def test_a_gate_that_no_stage_passes_is_not_asked() -> None:
    """Flights of certified plans without any other gate were said to miss it."""
    aside = ab.tilted_gate((2.0, 50.0, 1.0), name="aside")
    way = ab.Waypoints((ab.Waypoint((5.0, 0.0, 0.0)),))
    plan = ab.plan(replace(ab.load_problem("line"), maneuver=way, gates=(aside,)), vehicle="agile-quad")
    flight = ab.fly(plan)
    for goal in (plan, plan.problem):
        score = ab.score(flight, goal)
        assert score.outcome is ab.Outcome.COMPLETE
        assert not score.passages
    assert criterion(plan.problem).startswith("the whole path within")
