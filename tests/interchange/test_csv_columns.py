"""Tables with a header: what is written is read back, and somebody else's path is flown."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat.errors import SpecError
from aerobat.flatness import reference
from aerobat.interchange import column_groups, read_csv, read_rows, write_columns, write_csv
from aerobat.interchange.columns import ALL, PAPER
from aerobat.planning import Miqp, Plan
from aerobat.simulation import load_flight
from aerobat.trajectory import Trajectory, save_trajectory
from command_lines import code, without_pictures
from shared_plans import shared_plan
from suites import examples


@pytest.fixture(scope="module")
def line() -> Plan:
    return shared_plan("line", planner=Miqp(order=5))


def test_columns_are_what_the_vehicle_does_by_names_that_any_reader_of_tables_knows(
    line: Plan, tmp_path: Path
) -> None:
    write_columns(line, tmp_path / "plan.csv", rate=50.0)
    with open(tmp_path / "plan.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    header = "t x y z vx vy vz ax ay az jx jy jz qw qx qy qz wx wy wz f0 f1 f2 f3"
    assert list(rows[0]) == header.split()
    times = np.array([float(row["t"]) for row in rows])
    np.testing.assert_array_equal(times, line.trajectory.sample(50.0))
    found = reference(line.trajectory, line.vehicle, times)
    for names, expected in (
        ("qw qx qy qz", found.setpoint.q_world_body),
        ("wx wy wz", found.setpoint.omega_body),
        ("f0 f1 f2 f3", found.rotor_thrusts),
        ("jx jy jz", line.trajectory.evaluate(times, 3)),
    ):
        columns = [[float(row[name]) for name in names.split()] for row in rows]
        np.testing.assert_array_equal(columns, expected)


@examples(15)
@given(seed=st.integers(0, 2**32 - 1), heading=st.floats(-3.1, 3.1), shuffled=st.booleans())
def test_a_table_comes_back_exactly_at_its_rows_in_any_order_of_columns(
    seed: int, heading: float, shuffled: bool, line: Plan, tmp_path_factory
) -> None:
    path = tmp_path_factory.mktemp("csv") / "plan.csv"
    rng = np.random.default_rng(seed)
    still = [[0.0, 0.0, 0.0]] * 3
    inputs = 40.0 * rng.normal(size=(6, 3))
    trajectory = Trajectory.from_inputs([rng.normal(size=3), *still], inputs, 0.0937, heading)
    write_columns(replace(line, trajectory=trajectory), path)
    if shuffled:
        table = [row.split(",") for row in path.read_text().splitlines()]
        order = rng.permutation(len(table[0]))
        lines = [",".join(row[i] for i in order) for row in table]
        path.write_text("\n".join(lines) + "\n")
    back = read_csv(path)
    times = trajectory.sample(100.0)
    for k in range(4):
        np.testing.assert_allclose(
            back.evaluate(times[:-1], k), trajectory.evaluate(times[:-1], k), rtol=1e-9, atol=1e-10 * 50**k
        )
    assert back.heading == pytest.approx(heading, abs=1e-9)


def test_positions_alone_give_the_smooth_path_and_a_bound_on_its_error(line: Plan, tmp_path: Path) -> None:
    """Through every second row it errs by more than through all of them."""
    path = tmp_path / "positions.csv"
    write_columns(line, path, ("time", "position"), rate=50.0)
    rows = read_rows(path)
    inner = np.linspace(0.1, line.duration - 0.1, 500)
    error = np.linalg.norm(rows.trajectory.evaluate(inner) - line.trajectory.evaluate(inner), axis=1).max()
    assert 0.0 < error < rows.fit_error < 2e-3


@pytest.mark.parametrize("rows", [4, 5, 6, 7])
def test_a_path_of_few_rows_is_judged_and_its_error_is_told_where_every_second_row_has_a_path(
    rows: int, tmp_path: Path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    text = "t,x,y,z\n" + "".join(f"{k},{0.1 * k**2},0,1\n" for k in range(rows))
    Path("path.csv").write_text(text)
    assert (read_rows("path.csv").fit_error is None) == (rows < 7)
    assert code("check", "path.csv") == 0
    known = "without every second row it is off by" in capsys.readouterr().out
    assert known == (rows == 7)


def test_what_a_path_assumes_is_told_of_a_folder_that_holds_it_too(
    tmp_path: Path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("kept").mkdir()
    rows = [f"{k},{0.1 * k**2},0,1,{k}" for k in range(9)]
    Path("kept/plan.csv").write_text("\n".join(["t,x,y,z,yaw", *rows, ""]))
    told = []
    for name in ("kept", "kept/plan.csv"):
        assert code("check", name, "--json") == 0
        told.append(json.loads(capsys.readouterr().out)["assumed"])
    assert told[0] == told[1]
    assert told[0][-2] == "column yaw left out"


@pytest.mark.parametrize(
    ("header", "options", "told"),
    [
        ("x,y,z,k", [], True),
        ("x,y,z,t_ms", [], True),
        ("x,y,z,k", ["--rate", "50"], False),
        ("x,y,z,t", [], False),
    ],
)
def test_the_rate_of_rows_without_times_is_told_where_nobody_gave_it(
    header: str, options: list[str], told: bool, tmp_path: Path, monkeypatch, capsys
) -> None:
    """The duration of a path with times in t_ms was that of 100 rows a second, without a word."""
    monkeypatch.chdir(tmp_path)
    Path("path.csv").write_text(f"{header}\n" + "".join(f"{0.1 * k**2},0,1,{k}\n" for k in range(9)))
    assert code("check", "path.csv", "--json", *options) in (0, 1)
    assumed = json.loads(capsys.readouterr().out)["assumed"]
    assert ("100 rows a second (--rate)" in assumed) == told


@pytest.mark.parametrize("command", ["check", "fly"])
def test_a_rate_beside_rows_with_times_is_told_to_be_unused(
    command: str, tmp_path: Path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("path.csv").write_text("t,x,y,z\n" + "".join(f"{k / 10},{0.001 * k**2},0,1\n" for k in range(9)))
    assert code(command, "path.csv", "--rate", "50") in (0, 1)
    told = " ".join("".join(capsys.readouterr()).split())
    assert "the times of its rows, not the 50 rows a second of --rate" in told


@pytest.mark.parametrize(
    "header",
    ["t,x,y,z", "# t,x,y,z", '"t","x","y","z"', "TIME,X,Y,Z", "time,px,py,pz", "t, x, y, z", ",t,x,y,z"],
)
def test_headers_as_others_write_them_are_understood(header: str, tmp_path: Path) -> None:
    """The last is that of a data frame, which writes its index without a name."""
    index = "0," if header.startswith(",") else ""
    rows = "".join(f"{index}{5 + k / 10},{k},0,1\n" for k in range(6))
    (tmp_path / "path.csv").write_text(f"{header}\n{rows}")
    path = read_csv(tmp_path / "path.csv")
    assert path.duration == pytest.approx(0.5)
    np.testing.assert_allclose(path.evaluate(path.duration), [5.0, 0.0, 1.0], atol=1e-12)


@pytest.mark.parametrize(("text", "named"), [("time,sped", "sped"), ("time,time", "twice"), ("", "columns")])
def test_groups_of_columns_that_are_none_are_refused(text: str, named: str) -> None:
    with pytest.raises(SpecError, match=named):
        column_groups(text)
    assert column_groups("position,time") == ("time", "position")
    assert column_groups(",".join(ALL)) == ALL


def test_somebody_elses_path_is_flown_and_what_is_assumed_is_said(
    tmp_path: Path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    without_pictures(monkeypatch)
    times = np.linspace(0.0, 4.0, 81)
    s = times / 4.0
    along = 3.0 * (35 * s**4 - 84 * s**5 + 70 * s**6 - 20 * s**7)
    rows = np.column_stack([times, along, 0.5 * along, 1.0 + 0.0 * along])
    np.savetxt("their path.csv", rows, delimiter=",", header="t,x,y,z")
    assert code("fly", "their path.csv", "--vehicle", "crazyflie", "--heading", "90", "--json") == 0
    out, err = capsys.readouterr()
    assert err.count("\n") == 1
    assert "holds a path alone" in err
    assert "without every second row it is off by" in err
    assert json.loads(out)["plan"]["planner"] == "file"
    flight = load_flight("out/their-path-crazyflie-flown/flight.npz")
    np.testing.assert_allclose(flight.states.position[-1], [3.0, 1.5, 1.0], atol=0.02)
    np.testing.assert_allclose(np.abs(flight.states.q_world_body[0]), np.sqrt([0.5, 0, 0, 0.5]), atol=1e-3)


@pytest.mark.slow
def test_the_flight_of_somebody_elses_path_is_repeated(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    without_pictures(monkeypatch)
    write_csv(shared_plan("line"), "path.csv")
    assert code("fly", "path.csv", "--out", "flown") == code("repeat", "flown")
    assert "the same as in flown/, bit for bit" in capsys.readouterr().err


def test_the_papers_bare_layout_is_written_on_demand(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    without_pictures(monkeypatch)
    shared_plan("line").save("line.plan")
    assert code("plan", "line.plan", "--columns", "paper", "--out", "kept") == 0
    assert np.loadtxt("kept/plan.csv", delimiter=",").shape[1] == 13
    columns = column_groups("time, position")
    write_columns(shared_plan("line"), "chosen.csv", columns)
    assert Path("chosen.csv").read_text().startswith("t,x,y,z\n")


@pytest.mark.parametrize(
    "arguments",
    [
        ("line", "--rate", "50"),
        ("line", "--heading", "0"),
        ("line", "--columns", "sped"),
        ("path.csv", "--order", "5"),
        ("path.csv", "--rate", "0"),
        ("wild.csv",),
        ("nowhere.csv",),
    ],
)
def test_options_and_paths_that_do_not_fit_are_refused(
    arguments: tuple[str, ...], tmp_path: Path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    without_pictures(monkeypatch)
    Path("path.csv").write_text("t,x,y,z\n0,0,0,1\n1,1,0,1\n2,1,0,1\n3,1,0,1\n")
    Path("wild.csv").write_text("t,x,y,z\n0,0,0,1\n1,1,0,1e30\n2,1,0,1\n3,1,0,1\n4,1,0,1\n")
    assert code("fly", *arguments) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not Path("out").exists()


@pytest.mark.parametrize("columns", [ALL, PAPER])
def test_a_rate_is_asked_to_be_higher_only_where_the_rows_have_no_times(
    columns: tuple[str, ...], line: Plan, tmp_path: Path
) -> None:
    timed, bare = tmp_path / "timed.csv", tmp_path / "bare.csv"
    write_columns(line, timed, columns)
    assert read_csv(timed, 1e-9).duration == line.duration  # the file's own times count, whatever the rate
    rows = [text.split(",") for text in timed.read_text().splitlines()]
    parts = slice(12) if columns == PAPER else slice(1, None)
    bare.write_text("".join(",".join(row[parts]) + "\n" for row in rows))
    with pytest.raises(SpecError, match=r"bare\.csv: rate is too low: \d+ rows at 1e-09 a second last more"):
        read_csv(bare, 1e-9)


@pytest.mark.parametrize("command", ["check", "fly"])
@pytest.mark.parametrize("file", ["kept/line.plan", "kept", "path.npz"])
def test_a_rate_of_rows_is_refused_of_files_without_rows(
    command: str, file: str, tmp_path: Path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    without_pictures(monkeypatch)
    Path("kept").mkdir()
    plan = shared_plan("line")
    plan.save("kept/line.plan")
    save_trajectory(plan.trajectory, "path.npz")
    assert code(command, file, "--rate", "50") == 2
    assert "--rate is for a CSV file, not for " in capsys.readouterr().err
    assert not Path("out").exists()


def test_columns_that_need_a_vehicle_are_refused_of_a_plan_without_one(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="the plan has none; plan for one"):
        write_columns(shared_plan("line", None), tmp_path / "thrusts.csv", ["thrusts"])
    with pytest.raises(SpecError, match="no group of columns named 'thrust'"):
        write_columns(shared_plan("line", None), tmp_path / "thrusts.csv", ["thrust"])
