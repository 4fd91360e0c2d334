"""A run can be repeated from its folder, and folders of different runs do not mix."""

from __future__ import annotations

import shutil
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

from aerobat.cli.runs.record import FlightSettings, RunRecord, read_record
from aerobat.environment import load_dispersion
from aerobat.interchange import read_trajectory
from aerobat.planning import MinSnap, Miqp, Planner, command_settings, load_plan, planner_class
from aerobat.problem import load_problem
from aerobat.simulation import load_flight
from aerobat.vehicle import load_vehicle
from command_lines import code, without_pictures
from shared_plans import shared_plan

RUNS = {
    "a flight under conditions": ("fly", "line", "--conditions", "lab", "--seed", "7", "--order", "5"),
    "an angle and another vehicle": ("fly", "half-flip", "--angle", "-30", "--vehicle", "crazyflie"),
    "the paper's program and law": ("fly", "flip-roll", "--paper", "--controller", "paper"),
    "a plan that passes": ("plan", "line", "--order", "4", "--pass", "0.5", "--autopilot", "betaflight"),
    "another planner, no flight": ("plan", "section-v", "--planner", "min-snap", "--stop-after", "3"),
    "a problem and a vehicle of one's own": (
        "fly",
        "mine.toml",
        "--vehicle",
        "heavy.toml",
        "--reserve",
        "0.1",
    ),
}
MINE = """
name = "mine"
heading_deg = 30.0
start = { position = [0.1, 0.2, 1.3] }
goal = { position = [2.7, 0.0, 1.0] }
environment = { gravity = 3.7, wind = [0.0, 1.0, 0.0], ground = 0.0 }
limits = { velocity = [2.5, inf, 1.5] }
maneuver = { kind = "line" }
"""


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run."""
    folder = tmp_path_factory.mktemp("runs") / "kept"
    with pytest.MonkeyPatch.context() as patch:
        without_pictures(patch)
        assert code("plan", "line", "--planner", "min-snap", "--out", folder) == 0
    return folder


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from aerobat.vehicle import write_vehicle

    monkeypatch.chdir(tmp_path)
    without_pictures(monkeypatch)
    Path("mine.toml").write_text(MINE)
    write_vehicle(replace(load_vehicle("agile-quad"), name="heavy", mass=1.1), "heavy.toml")


@pytest.mark.slow
@pytest.mark.parametrize("run", RUNS)
def test_a_run_repeated_from_its_folder_alone_gives_the_same_bits(run: str, capsys) -> None:
    well = code(*RUNS[run], "--out", "first")
    for file in ("mine.toml", "heavy.toml"):
        Path(file).unlink()  # the folder holds their contents
    capsys.readouterr()
    assert code("repeat", "first") == well
    assert capsys.readouterr().err == "aerobat: the same as in first/, bit for bit\n"
    first, again = (read_trajectory(folder) for folder in ("first", "first-repeated"))
    np.testing.assert_array_equal(first.coefficients, again.coefficients)
    if RUNS[run][0] == "fly":
        flights = [load_flight(f"{folder}/flight.npz") for folder in ("first", "first-repeated")]
        for name, series in flights[0].series.items():
            np.testing.assert_array_equal(series, flights[1].series[name])
    assert Path("first/run.toml").read_text() == Path("first-repeated/run.toml").read_text()


def test_a_saved_plan_that_was_flown_is_flown_again_not_planned(capsys) -> None:
    shared_plan("line").save("line.plan")
    Path("weak.toml").write_text("mass = 0.03\n")
    assert code("fly", "line.plan", "--conditions", "weak.toml") == 0
    assert code("repeat", "out/line-flown-weak") == 0
    assert "the same as" in capsys.readouterr().err


def test_a_run_is_repeated_beside_the_folder_that_one_is_in(monkeypatch, capsys) -> None:
    shared_plan("line").save("line.plan")
    assert code("fly", "line.plan", "--conditions", "none", "--out", "flown") == 0
    Path("flown/inner").mkdir()
    for place, folder in (("flown", "."), ("flown/inner", "..")):
        with monkeypatch.context() as patch:
            patch.chdir(place)
            assert code("repeat", folder) == 0
            assert "the same as in" in capsys.readouterr().err
    assert {path.name for path in Path().glob("flown*")} == {"flown", "flown-repeated"}


def test_a_saved_plan_that_was_flown_with_a_plugin_is_recorded_with_it(capsys) -> None:
    shared_plan("line").save("line.plan")
    Path("mine.py").write_text("")
    assert code("fly", "line.plan", "--import", "mine.py", "--out", "flown") == 0
    assert read_record(Path("flown")).plugins == ("mine.py",)
    assert "`aerobat sweep flown --import mine.py` counts more flights" in capsys.readouterr().out


def test_what_is_planned_anew_from_a_folder_alone_is_the_same_bit_by_bit(kept: Path, capsys) -> None:
    assert code("repeat", kept, "--out", "again") == 0
    assert capsys.readouterr().err == f"aerobat: the same as in {kept}/, bit for bit\n"
    first, again = (read_trajectory(folder) for folder in (kept, "again"))
    np.testing.assert_array_equal(first.coefficients, again.coefficients)
    assert (kept / "run.toml").read_text() == Path("again/run.toml").read_text()


def test_a_comparison_is_repeated_too(capsys, monkeypatch) -> None:
    monkeypatch.setattr("aerobat.studies.compare.registered_planners", lambda: {"min-snap": MinSnap})
    assert code("compare", "line") == 0
    assert code("repeat", "out/line-compare", "--explain") == 2  # there is no report on a plan
    assert "--explain is for a plan or a flight" in capsys.readouterr().err
    assert code("repeat", "out/line-compare") == 0
    assert "the same as in out/line-compare/" in capsys.readouterr().err
    Path("out/line-compare/compare.json").write_text("3")
    assert code("repeat", "out/line-compare") == 2
    assert "compare.json holds other facts than were written" in capsys.readouterr().err


def test_a_repetition_that_comes_to_something_else_says_what_and_exits_with_1(kept: Path, capsys) -> None:
    shutil.copytree(kept, "out/line")
    record = tomllib.loads(Path("out/line/run.toml").read_text())
    record["problem"]["goal"]["position"] = [8.0, 0.0, 0.0]
    record["versions"]["numpy"] = "1.0"
    Path("out/line/run.toml").write_text(tomli_w.dumps(record))
    capsys.readouterr()
    assert code("repeat", "out/line") == 1
    err = capsys.readouterr().err
    assert err.startswith("aerobat: not the same as in out/line/: the plan takes ")
    assert err.endswith("(other versions of numpy)\n")


def as_the_command_has_it(planner: str, **options: Any) -> Planner:
    cls: Any = planner_class(planner)
    return cls(**command_settings(cls) | options)


@pytest.mark.parametrize(
    ("options", "ending"),
    [
        ({}, ""),
        ({"order": 4}, "-order-4"),
        ({"intervals": 30, "reserve": 0.2}, "-intervals-30-reserve-0.2"),
        ({"time_limit": 2.5}, "-time-limit-2.5"),
    ],
)
def test_a_folders_name_holds_the_planners_options_that_are_not_default(
    options: dict[str, Any], ending: str
) -> None:
    planner = as_the_command_has_it("miqp", **options)
    line, quad = load_problem("line"), load_vehicle("agile-quad")
    record = RunRecord(command="fly", problem=line, vehicle=quad, planner=planner)
    assert record.folder == Path(f"out/line{ending}")


def test_a_folders_name_holds_how_it_is_flown_where_that_is_not_default() -> None:
    line, quad, planner = load_problem("line"), load_vehicle("agile-quad"), as_the_command_has_it("miqp")
    settings = FlightSettings("paper", load_dispersion("lab"), seed=3, plant="mujoco")
    record = RunRecord(command="fly", problem=line, vehicle=quad, planner=planner, flight=settings)
    assert record.folder == Path("out/line-lab-seed-3-paper-mujoco")
    far = replace(record, over=tuple(f"gate.width={k}:{k + 1}:0.01" for k in range(40)))
    assert len(far.folder.name) < 255
    assert far.folder != replace(far, over=far.over[:-1]).folder


def test_runs_that_differ_in_more_than_settings_have_folders_of_their_own() -> None:
    problem, quad, other = load_problem("half-flip"), load_vehicle("agile-quad"), load_vehicle("crazyflie")
    folders = [
        RunRecord(
            command=command, problem=problem, vehicle=vehicle,
            planner=planner and as_the_command_has_it(planner), angle=angle, paper=paper,
        ).folder
        for command in ("fly", "compare")
        for planner in (("miqp", "min-snap", "free-knots", None) if command == "fly" else (None,))
        for vehicle in (quad, other)
        for angle in (None, 0.0, 45.0)
        for paper in (False, True)
    ]  # fmt: skip
    assert len(set(folders)) == len(folders)
    assert Path("out/half-flip") in folders


def test_a_folders_name_holds_nothing_that_leads_elsewhere() -> None:
    strange = replace(load_vehicle("agile-quad"), name="../a b/c:d")
    record = RunRecord(command="fly", problem=load_problem("line"), vehicle=strange, planner=Miqp())
    assert record.folder.parent == Path("out")
    assert ":" not in record.folder.name


@pytest.mark.parametrize(
    ("command", "work"),
    [
        (("fly", "line.plan"), "fly.plan_of"),
        (("plan", "line.plan"), "plan.plan_of"),
        (("compare", "line"), "compare.compare_planners"),
        (("sweep", "line.plan"), "sweep.sweep_plan"),
        (("repeat", "kept"), "repeat.plan_of"),
    ],
)
def test_a_folder_of_others_is_refused_before_anything_is_planned_or_flown(
    command: tuple[str, ...], work: str, kept: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    def never(*arguments: object, **options: object) -> None:
        raise AssertionError(f"{work} was called")

    shared_plan("line").save("line.plan")
    shutil.copytree(kept, "kept")
    Path("mine").mkdir()
    Path("mine/thesis.tex").write_text("years of work")
    monkeypatch.setattr(f"aerobat.cli.commands.{work}", never)
    assert code(*command, "--out", "mine") == 2
    assert "mine/ holds thesis.tex, which no run wrote" in capsys.readouterr().err
    assert not list(Path().glob("mine-*"))


def test_an_earlier_run_that_is_replaced_is_said_and_leaves_nothing_behind(kept: Path, capsys) -> None:
    shared_plan("line").save("line.plan")
    shutil.copytree(kept, "out/line")
    Path("out/line/flight.npz").write_bytes(b"of an earlier flight")
    code("plan", "line.plan", "--out", "out/line")
    assert capsys.readouterr().out.endswith("written to out/line/, in the place of an earlier run\n")
    assert not Path("out/line/flight.npz").exists()


def test_check_judges_a_folder_for_the_vehicle_that_flew(capsys) -> None:
    shared_plan("line").save("line.plan")
    code("fly", "line.plan", "--vehicle", "heavy.toml", "--out", "out/line-heavy")
    capsys.readouterr()
    assert code("check", "out/line-heavy") == 1  # the plan is for a lighter one
    assert "heavy" in capsys.readouterr().out
    assert load_plan("out/line-heavy/line.plan").vehicle == read_record(Path("out/line-heavy")).vehicle


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (None, "has no run.toml"),
        (b"\xff\xfe", "run.toml"),
        (b"command = 'fly'", "problem"),
        (b"[problem", "not valid TOML"),
        (b"format = 'aerobat-run-9'", "run.toml"),
    ],
)
def test_a_folder_whose_run_is_not_whole_is_refused_in_a_sentence(content, named: str, capsys) -> None:
    Path("run").mkdir()
    if content is not None:
        Path("run/run.toml").write_bytes(content)
    assert code("repeat", "run") == 2
    err = capsys.readouterr().err
    assert named in err
    assert err.count("\n") == 1
    assert [path.name for path in Path().iterdir() if path.is_dir()] == ["run"]
