"""The reference code's CSV layout, there and back, and what is no such file."""

import os
import stat
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat.errors import SpecError
from aerobat.interchange import read_csv, read_plan, read_rows, write_csv
from aerobat.interchange.rows import SHORT_STEP
from aerobat.trajectory import Trajectory
from suites import examples

seeds = st.integers(0, 2**32 - 1)


def random_trajectory(seed, order=4, dt=0.1, intervals=5):
    rng = np.random.default_rng(seed)
    initial = rng.normal(size=(order, 3))
    return Trajectory.from_inputs(initial, 50 * rng.normal(size=(intervals, 3)), dt)


def read_back(seed, rate, tmp_path_factory):
    """A random polynomial of degree 9 on one segment, and the path that its file is read back as."""
    trajectory = Trajectory([1.0], np.random.default_rng(seed).normal(size=(1, 10, 3)))
    path = tmp_path_factory.mktemp("csv") / "plan.csv"
    write_csv(trajectory, path, rate)
    return trajectory, read_csv(path, rate)


@examples(30)
@given(seed=seeds, order=st.integers(3, 5), dt=st.floats(0.02, 0.3))
def test_rows_come_back_exactly_and_so_does_the_duration(seed, order, dt, tmp_path_factory):
    trajectory = random_trajectory(seed, order, dt)
    path = tmp_path_factory.mktemp("csv") / "plan.csv"
    write_csv(trajectory, path)
    back = read_csv(path)
    assert back.duration == pytest.approx(trajectory.duration, abs=1e-11)
    times = trajectory.sample(100.0)
    if times[-1] - times[-2] < SHORT_STEP * 0.01:  # a row that the grid leaves so near the end is left out
        times = np.delete(times, -2)
    for k in range(4):
        rows = trajectory.evaluate(times, k)
        again = np.concatenate([back.on_segments([0.0], k)[:, 0], back.on_segments([1.0], k)[-1]])
        np.testing.assert_allclose(again, rows, rtol=1e-9, atol=1e-12 * 10 ** (2.5 * k))


@examples(20)
@given(seed=seeds, rate=st.floats(10.0, 60.0))
def test_a_polynomial_of_degree_nine_comes_back_between_rows_too(seed, rate, tmp_path_factory):
    trajectory, back = read_back(seed, rate, tmp_path_factory)
    times = np.linspace(0.0, min(back.duration, 1.0), 777)
    for k, tolerance in enumerate((1e-11, 1e-9, 1e-7, 1e-5, 1e-3)):
        assert np.abs(back.evaluate(times, k) - trajectory.evaluate(times, k)).max() < tolerance


@examples(20)
@given(seed=seeds, rate=st.floats(20.0, 400.0))
def test_between_rows_the_error_is_that_of_hermite_interpolation(seed, rate, tmp_path_factory):
    # a polynomial of degree 9 on one segment: |error| ≤ max|p⁽⁸⁾| h⁸ / (8! 2⁸)
    trajectory, back = read_back(seed, rate, tmp_path_factory)
    times = np.linspace(0.0, min(back.duration, 1.0), 1500)
    error = np.abs(back.evaluate(times) - trajectory.evaluate(times)).max()
    bound = np.abs(trajectory.on_segments(np.linspace(0, 1, 50), 8)).max() / rate**8 / (40320 * 256)
    assert error <= 1.8 * bound + 1e-12


def test_degree_seven_comes_back_everywhere(tmp_path):
    trajectory = Trajectory([0.5], np.random.default_rng(0).normal(size=(1, 8, 3)))
    write_csv(trajectory, tmp_path / "plan.csv", 10.0)
    back = read_csv(tmp_path / "plan.csv", 10.0)
    for k in range(6):
        s = np.linspace(0.01, 0.49, 100)
        expected = trajectory.evaluate(s, k)
        np.testing.assert_allclose(back.evaluate(s, k), expected, atol=1e-12 * 50**k)


def test_whole_periods_give_the_reference_layout_itself(tmp_path):
    trajectory = random_trajectory(1, order=3, dt=0.1, intervals=20)
    write_csv(trajectory, tmp_path / "plan.csv")
    lines = (tmp_path / "plan.csv").read_text().splitlines()
    assert len(lines) == 201
    numbers = np.loadtxt(tmp_path / "plan.csv", delimiter=",")
    assert numbers.shape == (201, 12)
    # row n·10 + k is the reference's sample k of segment n: p, v, a, j at n·dt + k·0.01
    for row, (n, k) in {0: (0, 0), 37: (3, 7), 150: (15, 0)}.items():
        expected = [trajectory.on_segments([k / 10], d)[n, 0] for d in range(4)]
        np.testing.assert_allclose(numbers[row], np.concatenate(expected), atol=1e-10)


def test_a_partial_last_step_adds_times_and_leaves_the_first_twelve_columns(tmp_path):
    trajectory = random_trajectory(1, order=3, dt=0.1234, intervals=10)
    write_csv(trajectory, tmp_path / "plan.csv")
    numbers = np.loadtxt(tmp_path / "plan.csv", delimiter=",")
    assert numbers.shape == (125, 13)
    np.testing.assert_array_equal(numbers[:, 12], trajectory.sample(100.0))
    assert numbers[-1, 12] == trajectory.duration
    np.testing.assert_array_equal(numbers[:, :3], trajectory.evaluate(trajectory.sample(100.0)))


def test_rows_that_the_reference_code_wrote_are_read(tmp_path):
    # its end row is missing and its numbers have twelve digits, as Python 2's str() gives
    trajectory = random_trajectory(4, order=3, dt=0.1, intervals=4)
    rows = []
    for n in range(4):
        for k in range(10):
            values = np.concatenate([trajectory.on_segments([k / 10], d)[n, 0] for d in range(4)])
            rows.append(",".join(f"{value:.12g}" for value in values))
    (tmp_path / "fliptraj.csv").write_text("\n".join(rows) + "\n")
    back = read_csv(tmp_path / "fliptraj.csv")
    assert back.duration == pytest.approx(0.39)
    np.testing.assert_allclose(back.evaluate(0.25), trajectory.evaluate(0.25), atol=1e-10)


GOOD = ",".join(["1.0"] * 12)
TIMED = [",".join([GOOD, time]) for time in ("0.0", "0.01", "0.015")]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (f"{GOOD}\n{GOOD},\n", "line 2"),
        (f"{GOOD}\n1,2,3\n", "line 2"),
        (f"{GOOD}\n{GOOD},0.5\n", "line 2"),
        (f"{GOOD}\n{GOOD},0.5,0.6\n", "line 2"),
        (f"{GOOD}\n\n{GOOD}\n", "line 2"),
        (f"{GOOD}\n{GOOD.replace('1.0', 'one', 1)}\n", "line 2"),
        (f"{GOOD}\n{GOOD}\n{GOOD.replace('1.0', 'nan', 1)}\n", "line 3"),
        (f"{GOOD}\n{GOOD.replace('1.0', '-inf', 1)}\n", "line 2"),
        (f"{GOOD}\n{GOOD.replace('1.0', '1e999', 1)}\n", "line 2"),
        (f"x,y,z\n{GOOD}\n{GOOD}\n", "line 2"),
        (f"x,y\n{GOOD}\n{GOOD}\n", "line 1"),
        ("t,x,y,z,x\n0,1,2,3,4\n1,1,2,3,4\n", "line 1"),
        ("t,x,y,z\n0,1,2,3\n0,1,2,3\n", "line 3"),
        ("t,x,y,z\n0,1,2,3\n1,1,2,3", "line 3"),
        ("t,x,y,z,qw,qx,qy,qz\n0,1,2,3,0,0,0,0\n1,1,2,3,0,0,0,0\n", "line 2"),
        (f"{GOOD}\n{GOOD[:-2]}", "line 2"),
        (GOOD.replace(",", ";") + "\n", "line 1"),
        (f"{TIMED[1]}\n{TIMED[2]}\n", "line 1"),
        (f"{TIMED[0]}\n{TIMED[2]}\n{TIMED[1]}\n", "line 3"),
        (f"{TIMED[0]}\n{TIMED[0]}\n", "line 2"),
        ("", "two lines"),
        (f"{GOOD}\n", "two lines"),
        ("\x00\x01", "line 1"),
        ("t [s],x [m],y [m],z [m]\n0,0,0,0\n1,0,0,0\n", "line 1 is neither numbers nor names of columns"),
    ],
)
def test_malformed_files_get_one_sentence_that_names_the_line(text, line, tmp_path):
    path = tmp_path / "plan.csv"
    path.write_text(text)
    with pytest.raises(SpecError, match=line) as caught:
        read_csv(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_any_truncation_is_noticed_or_leaves_whole_rows(tmp_path):
    whole, cut = tmp_path / "whole.csv", tmp_path / "cut.csv"
    trajectory = random_trajectory(2, dt=0.0123)
    write_csv(trajectory, whole)
    text = whole.read_text()
    for length in range(0, len(text), 7):
        cut.write_text(text[:length])
        if text[:length].endswith("\n") and text[:length].count("\n") > 1:
            assert read_csv(cut).segments == text[:length].count("\n") - 1
        else:
            with pytest.raises(SpecError):
                read_csv(cut)


def test_files_that_are_not_there_or_not_text_are_refused(tmp_path):
    (tmp_path / "bytes.csv").write_bytes(b"\xff\xfe\x00")
    for path in (tmp_path / "nowhere.csv", tmp_path, tmp_path / "bytes.csv"):
        with pytest.raises(SpecError, match=str(path)):
            read_csv(path)
    for rate in (0.0, -1.0, np.nan):
        with pytest.raises(SpecError, match="rate"):
            read_csv(tmp_path / "nowhere.csv", rate)


def test_a_problem_that_is_taken_for_a_plan_is_refused_with_the_command_that_plans_it(tmp_path):
    (tmp_path / "mine.toml").write_text("name = 'mine'")
    with pytest.raises(SpecError, match=r"mine.toml holds no plan; `aerobat fly .*mine.toml` makes that"):
        read_plan(tmp_path / "mine.toml")


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "plan.csv"
    path.write_text("old")

    def full(source, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(SpecError, match="No space left"):
        write_csv(random_trajectory(0), path)
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["plan.csv"]


def test_a_place_that_cannot_be_is_refused_by_its_name(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(SpecError, match=r"cannot write .*plan.csv"):
        write_csv(random_trajectory(0), tmp_path / "file" / "plan.csv")


def test_a_written_file_has_the_rights_that_any_new_file_has(tmp_path):
    (tmp_path / "other").touch()
    write_csv(random_trajectory(0), tmp_path / "plan.csv")
    modes = [stat.S_IMODE(os.stat(tmp_path / name).st_mode) for name in ("other", "plan.csv")]
    assert modes[0] == modes[1]


def test_empty_lines_at_the_end_are_no_rows_and_what_is_not_used_is_named(tmp_path):
    path = tmp_path / "path.csv"
    rows = [f"{0.1 * k},{0.01 * k**2},0,0,1,0,0,0,30" for k in range(6)]
    path.write_text("\n".join(["t,x,y,z,qw,qx,qy,qz,yaw", *rows, "", ""]))
    found = read_rows(path)
    assert found.trajectory.duration == pytest.approx(0.5)
    assert found.unused == ("attitudes after the first row", "column yaw")
