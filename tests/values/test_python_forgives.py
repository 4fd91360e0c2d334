"""Names for objects, plans for trajectories, and a sentence for what is meant otherwise."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from math import inf, pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aerobat as ab
from aerobat.arrays import numbers
from aerobat.viewer import replay
from public_calls import NoPlan, flight, plan
from refusals import complaint

LINE = ab.load_problem("line")
QUAD = ab.load_vehicle("agile-quad")


def test_a_problem_a_planner_and_a_vehicle_go_by_their_names() -> None:
    assert ab.plan("line").trajectory == ab.plan(LINE, None, QUAD).trajectory
    with pytest.raises(ab.Infeasible, match="nothing to be found"):
        ab.plan("line", NoPlan(), "agile-quad")
    with pytest.raises(ab.Infeasible, match="no planner finds a plan for 'line' on agile-quad"):
        ab.compare("line", "agile-quad", [("none", NoPlan())])
    assert ab.fly(plan(), "agile-quad", rate=100.0, engine="floats") == flight()
    assert ab.fly(plan(), ["agile-quad"] * 2, rate=100.0).vehicles == ("agile-quad",) * 2
    assert ab.score(flight(), "line", "agile-quad").outcome is ab.Outcome.COMPLETE
    assert len(ab.score_flights(plan(), "agile-quad", problem="line", rate=100.0)) == 1
    assert ab.certify(plan().trajectory, "agile-quad") == ab.certify(plan())


def test_the_path_of_a_file_is_taken_where_a_name_is(tmp_path: Path) -> None:
    """A path as text was taken, one of `pathlib` refused."""
    ab.write_vehicle(QUAD, tmp_path / "mine.toml")
    ab.write_problem(LINE, tmp_path / "mine-too.toml")
    ab.write_dispersion(ab.load_dispersion("none"), tmp_path / "calm.toml")
    assert ab.fly(plan(), conditions=tmp_path / "calm.toml") == ab.fly(plan(), conditions="none")
    assert ab.fly(plan(), [tmp_path / "mine.toml"] * 2, rate=100.0).vehicles == ("agile-quad",) * 2
    assert (
        ab.score(flight(), tmp_path / "mine-too.toml", tmp_path / "mine.toml").outcome is ab.Outcome.COMPLETE
    )


def test_a_problem_is_planned_for_the_vehicle_that_the_command_line_takes() -> None:
    assert ab.plan("line").vehicle == QUAD
    assert ab.plan("line").certified
    assert ab.plan("line", vehicle=None).vehicle is None


def test_a_flight_takes_the_name_of_a_control_law_at_the_gains_of_its_vehicle() -> None:
    mine = dataclasses.replace(QUAD, controller=dataclasses.replace(QUAD.controller, position_gain=20.0))
    law = ab.Controller.paper()
    flown, named = (
        ab.fly(plan(), mine, rate=100.0, engine="floats", controller=controller)
        for controller in (dataclasses.replace(law, position_gain=20.0), "paper")
    )
    assert flown == named
    assert named != ab.fly(plan(), mine, rate=100.0, engine="floats")


def test_a_misspelt_public_name_is_answered_by_the_closest() -> None:
    with pytest.raises(AttributeError, match="aerobat has no 'plam'; did you mean 'plan'"):
        ab.plam  # noqa: B018


def test_a_public_name_whose_module_fails_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(vars(ab), "view", raising=False)  # kept there once it was used
    monkeypatch.delattr(replay, "view")  # as of a module that could not be imported whole
    with pytest.raises(AttributeError, match=r"^module 'aerobat.viewer.replay' has no attribute 'view'$"):
        ab.view  # noqa: B018


def test_a_plan_stands_for_its_trajectory_its_vehicle_and_its_environment(tmp_path: Any) -> None:
    windy = ab.Environment(gravity=5.0, wind=(1.0, 0.0, 0.0))
    elsewhere = dataclasses.replace(plan(), problem=dataclasses.replace(plan().problem, environment=windy))
    trajectory = plan().trajectory
    assert ab.certify(elsewhere) == ab.certify(trajectory, QUAD, windy)
    assert ab.reference(elsewhere, rate=10.0) == ab.reference(trajectory, QUAD, rate=10.0, environment=windy)
    ab.save_trajectory(plan(), tmp_path / "a.npz")
    ab.write_csv(plan(), tmp_path / "a.csv")
    assert ab.load_trajectory(tmp_path / "a.npz") == trajectory
    assert ab.read_csv(tmp_path / "a.csv").duration == trajectory.duration


def test_a_plan_is_drawn_without_a_flight_and_a_flight_with_the_vehicle_of_its_plan() -> None:
    titles = [text.get_text() for text in ab.draw(plan()).texts]
    assert any("short" in title and "agile-quad" in title for title in titles)
    mine = dataclasses.replace(QUAD, name="mine")
    own = dataclasses.replace(plan(), vehicle=mine)
    flown = ab.fly(own, rate=100.0)
    assert ab.draw(flown, own).texts
    assert complaint(lambda: ab.draw(flown)).startswith("no vehicle named 'mine'")
    assert complaint(lambda: ab.draw(dataclasses.replace(plan(), vehicle=None))).startswith("vehicle is miss")


@pytest.mark.parametrize(
    ("write", "load", "value"),
    [
        (ab.write_problem, ab.load_problem, LINE),
        (ab.write_vehicle, ab.load_vehicle, QUAD),
    ],
)
def test_a_file_is_read_under_any_name_that_is_no_built_in_one(
    write: Callable[..., None], load: Callable[..., Any], value: Any, tmp_path: Any, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    other = dataclasses.replace(value, name="mine")
    for name in ("mine", "mine.txt", value.name):
        write(other, name)
    assert load("mine") == load("mine.txt") == other
    assert load(value.name) == value


def test_a_planner_is_compared_under_its_registered_name() -> None:
    (found,) = ab.compare("line", "agile-quad", [ab.MinSnap()]).entries
    assert found.planner == "min-snap"
    assert found.certified


MEANT: dict[str, tuple[Callable[[], Any], str]] = {
    "a problem's name for the plan": (
        lambda: ab.fly("half-flip"),
        "fly: plan must be a plan or a Trajectory, got 'half-flip'; plan it first, as ab.plan('half-flip')",
    ),
    "conditions for the vehicle": (
        lambda: ab.fly(plan(), "lab"),
        "'lab' are conditions, not a vehicle; give conditions='lab'",
    ),
    "a planner's option for plan()": (
        lambda: ab.plan("line", intervals=30),  # type: ignore[call-arg]
        "plan: got an unexpected keyword argument 'intervals'; intervals is an option of planners (miqp), "
        "say planner=ab.Miqp(intervals=...)",
    ),
    "a misspelt argument": (
        lambda: ab.plan("line", vehicel="agile-quad"),  # type: ignore[call-arg]
        "plan: got an unexpected keyword argument 'vehicel'; did you mean vehicle?",
    ),
    "a controller that nobody knows": (
        lambda: ab.fly(plan(), controller="papr"),
        "FlightConfig.controller: no controller named 'papr'; did you mean 'paper'? Known: ",
    ),
    "a vehicle for the planner": (
        lambda: ab.plan(LINE, QUAD),
        "plan: planner must be a Planner or a name, got a Vehicle; did you mean vehicle=...?",
    ),
    "a vehicle's name for the planner": (
        lambda: ab.plan("line", "agile-quad"),
        "'agile-quad' is a vehicle, not a planner; give vehicle='agile-quad'",
    ),
    "a planner that is not made": (
        lambda: ab.plan(LINE, ab.Miqp),
        "planner must be a Planner or a name, got the class Miqp; make one, as Miqp()",
    ),
    "a number for a planner": (
        lambda: ab.compare(LINE, QUAD, [3]),  # type: ignore[list-item]
        "compare: planners[0] must be a tuple of a name and a Planner, a Planner or a name, got 3",
    ),
    "a vehicle for the plan": (
        lambda: ab.fly(QUAD, plan()),
        "fly: plan must be a plan or a Trajectory, got a Vehicle; did you mean vehicle=...?",
    ),
    "a misspelt problem": (
        lambda: ab.plan("flip-rol"),
        "no problem named 'flip-rol'; did you mean 'flip-roll'? Known: ",
    ),
    "a quantity that is none": (
        lambda: ab.Condition("thrust", (0.0, 0.0, 1.0), lower=1.0),
        "Condition.quantity must be 'position', 'velocity', 'acceleration' or ",
    ),
    "a derivative that is none": (
        lambda: LINE.limits.of(9),
        "Limits.of: derivative must be 5 or less, got 9",
    ),
    "a negative derivative": (
        lambda: plan().trajectory.evaluate(0.0, -1),
        "derivative must be a whole number from 0 to 31, got -1",
    ),
    "samples beyond all memory": (
        lambda: plan().trajectory.sample(1e15),
        "rate must ask for 10000000 samples at most, 1000000000000000.0 asks ",
    ),
    "a mass in text": (
        lambda: dataclasses.replace(QUAD, mass="0.85"),
        "Vehicle.mass must be a number, got '0.85'",
    ),
    "a folder in a problem's name": (
        lambda: dataclasses.replace(LINE, name="../../up"),
        "Problem.name must be letters, digits, spaces, points and dashes, got '../../up'",
    ),
    "a line's end in a problem's name": (
        lambda: dataclasses.replace(LINE, name="a\nb"),
        "Problem.name must be one line of text, got 'a\\nb'",
    ),
    "a NUL in a path": (
        lambda: ab.load_plan("a\0b"),
        "load_plan: path must be a path, got 'a\\x00b'",
    ),
    "a heading of the flight": (
        lambda: ab.fly(plan(), yaw=90),
        "FlightConfig.yaw is not a known key; ",
    ),
    "a flight that is not there": (
        lambda: ab.fly(plan(), [QUAD, QUAD], rate=100.0)[2],
        "there are 2 flights, no flight 2; count from 0",
    ),
}


@pytest.mark.parametrize("case", MEANT)
def test_what_is_meant_otherwise_is_told_in_a_sentence(case: str) -> None:
    call, said = MEANT[case]
    assert complaint(call).startswith(said)


DEGREES: dict[str, Callable[[float], Any]] = {
    "heading": lambda angle: dataclasses.replace(LINE, heading=angle),
    "tilt": lambda angle: ab.tilted_gate((0.0, 0.0, 0.0), tilt=angle),
    "elevation": lambda angle: ab.tilted_gate((0.0, 0.0, 0.0), elevation=angle),
    "Trajectory: heading": lambda angle: dataclasses.replace(plan().trajectory, heading=angle),
    "Envelope.tilt": lambda angle: ab.Envelope(tilt=angle),
    "Gate.tilted: tilt": lambda angle: ab.tilted_gate((0.0, 0.0, 0.0)).tilted(angle),
}


@pytest.mark.parametrize("name", DEGREES)
def test_degrees_where_radians_are_meant_are_told_in_radians(name: str) -> None:
    said = complaint(lambda: DEGREES[name](90.0))
    assert f"{name} must be an angle in radians, from -4π to 4π, got 90; 90° is 1.571 rad" in said
    assert complaint(lambda: DEGREES[name](2.0 * pi)) == ""


def test_a_tilt_without_limit_and_any_number_of_degrees_are_what_they_say() -> None:
    assert ab.Envelope(tilt=inf) == ab.Envelope()
    assert ab.Flip(axis_deg=270.0).axis_deg == 270.0


def test_series_are_read_by_their_labels_and_refused_by_others() -> None:
    """They were read by position, without a word."""
    pd = pytest.importorskip("pandas")
    labelled = pd.Series({"y": 2.0, "x": 1.0, "z": 3.0})
    assert ab.tilted_gate(labelled).position.tolist() == [1.0, 2.0, 3.0]
    assert ab.EndState(pd.Series({"z": 3.0, "y": 2.0, "x": 1.0})).position.tolist() == [1.0, 2.0, 3.0]
    assert ab.Waypoint(pd.Series({"z": 3.0, "x": 1.0})).position[[0, 2]].tolist() == [1.0, 3.0]
    numbered = pd.Series([1.0, 2.0, 3.0], index=[4, 5, 6])
    assert ab.tilted_gate(numbered).position.tolist() == [1.0, 2.0, 3.0]
    rows = pd.DataFrame([labelled, 2.0 * labelled])
    assert numbers(rows, "rows").tolist() == [[1.0, 2.0, 3.0], [2.0, 4.0, 6.0]]
    strange = pd.Series({"roll": 1.0, "pitch": 2.0, "yaw": 3.0})
    for make in (lambda: ab.at_rest(strange), lambda: numbers(strange, "v"), lambda: ab.EndState(strange)):
        said = complaint(make)
        assert "must be labelled x, y, z, got the labels ['roll', 'pitch', 'yaw']; give .to_numpy()" in said


def test_numbers_of_numpy_are_numbers() -> None:
    assert ab.fly(plan(), rate=np.float32(100.0), engine="floats") == flight()
    assert ab.Miqp(intervals=np.int64(12)).intervals == 12
    assert plan().trajectory.sample(np.float64(10.0)).tolist() == plan().trajectory.sample(10.0).tolist()
