"""Values are their content: equal, hashed, copied and pickled by it; a line each; tables and pictures."""

from __future__ import annotations

import copy
import dataclasses
import pickle
import sys
from base64 import b64encode
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat.flatness import reference_of
from public_calls import VALUES, flight, instance, plan

LINE = 500  # letters: what a terminal shows in a few lines
PNG = b"\x89PNG"
SHOWN: dict[str, Callable[[], Any]] = {
    "plan": plan,
    "flight": flight,
    "comparison": lambda: instance(ab.Comparison),
    "certificate": lambda: ab.certify(plan()),
    "score": lambda: ab.score(flight(), plan()),
}


@pytest.mark.parametrize("cls", VALUES, ids=lambda cls: cls.__name__)
def test_what_is_copied_or_pickled_is_equal_and_hashed_alike(cls: type) -> None:
    value = instance(cls)
    for same in (pickle.loads(pickle.dumps(value)), copy.deepcopy(value), dataclasses.replace(value)):
        assert same == value
        assert hash(same) == hash(value)


@pytest.mark.parametrize("cls", VALUES, ids=lambda cls: cls.__name__)
def test_every_value_is_a_line_of_text(cls: type) -> None:
    text = str(instance(cls))
    assert 0 < len(text) <= LINE
    assert text.isprintable()


@pytest.mark.parametrize("value", [plan(), flight(), plan().trajectory], ids=lambda v: type(v).__name__)
def test_long_values_are_represented_by_their_line(value: Any) -> None:
    assert len(repr(value)) <= LINE + 20
    assert type(value).__name__ in repr(value)


def test_what_is_read_from_its_file_equals_what_was_written(tmp_path: Path) -> None:
    problem, vehicle = ab.load_problem("section-v"), ab.load_vehicle("crazyflie")
    certified = dataclasses.replace(plan(), starts=(1.0, 2.0))
    certified.save(tmp_path / "a.plan")
    flight().save(tmp_path / "a.npz")
    ab.save_trajectory(certified, tmp_path / "b.npz")
    ab.write_problem(problem, tmp_path / "a.toml")
    ab.write_vehicle("crazyflie", tmp_path / "b.toml")
    assert ab.load_plan(tmp_path / "a.plan") == certified
    assert ab.load_flight(tmp_path / "a.npz") == flight()
    assert ab.load_trajectory(tmp_path / "b.npz") == certified.trajectory
    assert ab.load_problem(tmp_path / "a.toml") == problem
    assert ab.load_vehicle(tmp_path / "b.toml") == vehicle


@given(st.integers(0, 1), st.integers(0, 4), st.integers(0, 2), st.floats(1e-9, 1.0))
def test_trajectories_that_differ_in_one_number_are_not_equal(
    segment: int, power: int, axis: int, change: float
) -> None:
    one = plan().trajectory
    coefficients = one.coefficients.copy()
    coefficients[segment, power, axis] += change
    other = dataclasses.replace(one, coefficients=coefficients)
    assert other != one
    assert dataclasses.replace(plan(), trajectory=other) != plan()
    assert len({one, other, dataclasses.replace(one)}) == 2


def test_what_is_not_known_equals_what_is_not_known() -> None:
    """A clearance without a vehicle is NaN, a negative zero is a zero."""
    one, other = (ab.BodyState(np.array([x, np.nan, 0]), *[np.zeros(3)] * 3) for x in (0.0, -0.0))
    assert one == other
    assert hash(one) == hash(other)


def test_what_can_still_change_is_compared_as_it_is() -> None:
    position = np.zeros(3)
    one, other = ab.BodyState(position, *[np.zeros(3)] * 3), ab.BodyState(np.zeros(3), *[np.zeros(3)] * 3)
    assert one == other
    position[0] = 1.0
    assert one != other
    assert hash(one) != hash(other)


def test_a_value_that_was_compared_is_used_as_before() -> None:
    times = [0.0, 0.1]
    flat = plan().trajectory.flat(times)
    again = ab.reference(plan(), times=times).setpoint.flat
    assert flat == again
    hash(again)
    assert reference_of(times, again, ab.load_vehicle("agile-quad")).setpoint.flat == flat


class Markup(HTMLParser):
    """The tags and the text of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text = ""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        if tag != "img":
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("plan", "0.200 s"),
        ("flight", "flown to the end"),
        ("comparison", "none"),
        ("certificate", "rotor"),
        ("score", "flown to the end"),
    ],
)
def test_notebooks_show_a_table_and_where_there_is_one_a_picture(name: str, told: str) -> None:
    value = SHOWN[name]()
    picture, page = value._repr_png_(), value._repr_html_()
    markup = Markup(page)
    assert not markup.open
    assert told in markup.text
    assert (picture is not None) == (name in ("plan", "flight", "comparison"))
    if picture is not None:
        assert picture.startswith(PNG)
        assert b64encode(picture).decode() in page


def test_a_plan_without_a_vehicle_has_a_table_and_no_picture() -> None:
    bare = dataclasses.replace(plan(), vehicle=None)
    assert bare._repr_png_() is None
    assert "short" in bare._repr_html_()


def test_tables_hold_the_numbers_of_what_they_are_made_of() -> None:
    one, many = ab.to_dataframe(flight()), ab.fly(plan(), ["agile-quad"] * 2, rate=100.0)
    np.testing.assert_array_equal(one["time"], flight().times)
    np.testing.assert_array_equal(one[["position_x", "position_y", "position_z"]], flight().position)
    np.testing.assert_array_equal(one[[f"thrusts_{k}" for k in range(4)]], flight().thrusts)
    np.testing.assert_array_equal(one[[f"q_world_body_{k}" for k in "wxyz"]], flight().series["q_world_body"])
    both = ab.to_dataframe(many)
    assert both.groupby("vehicle").size().tolist() == [len(many[k].times) for k in range(2)]
    scores = ab.to_dataframe(ab.score_flights(plan(), ["agile-quad"] * 3, rate=100.0))
    assert len(scores) == 3
    assert set(scores["outcome"]) == {"complete"}
    assert ab.to_dataframe(plan()).empty
    compared = ab.to_dataframe(instance(ab.Comparison))
    assert compared["duration_s"].tolist() == [plan().duration]
    assert len(ab.to_dataframe(plan().certificate.findings)) == len(plan().certificate.findings)


@pytest.mark.parametrize("cls", [cls for cls in VALUES if cls is not ab.Plan], ids=lambda cls: cls.__name__)
def test_every_value_has_rows_and_several_of_them_a_row_each(cls: type) -> None:
    """But for a plan without attempts: these are its rows."""
    value = instance(cls)
    assert len(ab.to_dataframe(value))
    assert len(ab.to_dataframe([value, value])) == len(ab.to_dataframe((value, value))) == 2


def test_tables_of_references_and_estimates_are_their_series_over_time() -> None:
    reference, estimates = instance(ab.Reference), instance(ab.Estimates)
    table = ab.to_dataframe(reference)
    np.testing.assert_array_equal(table["time"], reference.times)
    acceleration = table[[f"setpoint_acceleration_{axis}" for axis in "xyz"]]
    np.testing.assert_array_equal(acceleration, reference.setpoint.flat.acceleration)
    np.testing.assert_array_equal(table["setpoint_thrust"], reference.setpoint.wrench.thrust)
    np.testing.assert_array_equal(table[[f"rotor_thrusts_{k}" for k in range(4)]], reference.rotor_thrusts)
    table = ab.to_dataframe(estimates)
    np.testing.assert_array_equal(table["time"], estimates.times)
    np.testing.assert_array_equal(table[[f"gyro_bias_{axis}" for axis in "xyz"]], estimates.gyro_bias)
    np.testing.assert_array_equal(table[[f"sigma_{k}" for k in range(15)]], estimates.sigma)


def test_a_mapping_in_a_line_of_text_is_shown_with_its_values() -> None:
    assert str(ab.Gradient(np.array(2.0), {"mass": np.array(0.5)})) == "Gradient(value=2, slopes=(mass=0.5))"


def test_without_pandas_a_table_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(
        ab.BackendMissing, match=r'needs pandas; install it with pip install "aerobat.pandas."$'
    ):
        ab.to_dataframe(flight())
