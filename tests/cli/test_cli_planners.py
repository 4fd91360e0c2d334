"""Planners, proofs and comparisons from the command line."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aerobat.interchange import read_trajectory, write_columns
from aerobat.planning import load_plan
from aerobat.vehicle import load_vehicle, write_vehicle
from command_lines import run, without_pictures
from shared_plans import shared_plan

ROW_KEYS = {
    "planner", "segments", "duration_s", "ratio", "certified", "min_margin_n", "planning_s",
    "max_position_error_m",
}  # fmt: skip


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    without_pictures(monkeypatch)


def test_a_planner_is_called_by_its_name(capsys) -> None:
    code, out, err = run(capsys, "plan", "line", "--planner", "min-snap", "--json")
    assert (code, err) == (0, "")
    assert json.loads(out)["plan"]["planner"] == "min-snap"
    assert load_plan("out/line-min-snap/line.plan").planner == "min-snap"


@pytest.mark.slow
def test_the_plan_nearest_to_the_optimum_flies_the_papers_second_example(capsys) -> None:
    arguments = ["fly", "section-v", "--vehicle", "section-v", "--planner", "time-optimal", "--json"]
    code, out, err = run(capsys, *arguments, "--conditions", "none")
    assert (code, err) == (0, "")
    report = json.loads(out)
    assert report["plan"]["planner"] == "time-optimal"
    assert report["flight"]["max_position_error_m"] < 0.02
    assert report["plan"]["certificate"]["certified"] is True
    folder = "out/section-v-section-v-time-optimal-none"
    assert read_trajectory(folder).duration == pytest.approx(report["plan"]["duration_s"])


@pytest.mark.slow
def test_stopped_early_the_rotors_saturate_and_the_report_says_so(capsys) -> None:
    arguments = ["--planner", "min-snap", "--vehicle", "section-v", "--stop-after", "6"]
    code, out, err = run(capsys, "fly", "section-v", *arguments, "--json")
    assert (code, err) == (1, "")  # not certified
    report = json.loads(out)
    assert report["plan"]["status"] == "stopped"
    assert report["plan"]["certificate"]["certified"] is False
    assert report["flight"]["saturated_fraction"] > 0.02
    assert report["flight"]["max_position_error_m"] > 0.05
    _, out, _ = run(capsys, "fly", str(next(Path("out").iterdir())))
    assert "not certified" in out


def test_check_proves_a_plan_from_its_file_its_folder_and_its_csv(capsys) -> None:
    Path("flip-roll").mkdir()
    shared_plan("flip-roll").save("flip-roll/flip-roll.plan")
    for plan in ("flip-roll", "flip-roll/flip-roll.plan"):
        code, out, err = run(capsys, "check", plan, "--json")
        assert (code, err) == (0, "")
        assert json.loads(out)["certified"] is True
    # between rows a file's path is not quite the plan's, which goes to the rotors' very limits
    quad = load_vehicle("agile-quad")
    rotors = tuple(replace(rotor, max_thrust=1.01 * rotor.max_thrust) for rotor in quad.rotors)
    write_vehicle(replace(quad, rotors=rotors), "stronger.toml")
    for rate in (100.0, 400.0, 1000.0):
        write_columns(shared_plan("flip-roll"), "flip-roll/plan.csv", rate=rate)
        code, out, _ = run(capsys, "check", "flip-roll/plan.csv", "--vehicle", "stronger.toml")
        assert (code, "certified" in out) == (0, True)


@pytest.mark.slow
def test_check_refuses_by_limit_time_and_size(capsys) -> None:
    shared_plan("flip-roll").save("flip-roll.plan")
    code, out, _ = run(capsys, "check", "flip-roll.plan", "--vehicle", "crazyflie")
    assert code == 1
    assert "not certified: command of rotor" in " ".join(out.split())
    for limit, quantity in (
        ("--max-speed=3", "speed"),
        ("--max-tilt=90", "tilt"),
        ("--max-rate=90", "body rate"),
    ):
        code, out, _ = run(capsys, "check", "flip-roll.plan", limit, "--json")
        assert code == 1
        found = json.loads(out)
        violated = [f for f in found["findings"] if f["verdict"] == "violated"]
        assert [f["quantity"] for f in violated] == [quantity]
        assert violated[0]["margin"] < 0.0
        assert quantity in found["why"]


@pytest.mark.slow
def test_compare_puts_all_planners_side_by_side(capsys) -> None:
    code, out, err = run(capsys, "compare", "race-7", "--json")
    assert (code, err) == (0, "")
    rows = json.loads(out)["planners"]
    assert [r["planner"] for r in rows] == ["miqp", "min-snap", "free-knots", "time-optimal"]
    assert all(row.keys() >= ROW_KEYS for row in rows)
    assert json.loads(out) == json.loads(Path("out/race-7-compare/compare.json").read_text())
    assert Path("out/race-7-compare/compare.png").read_bytes().startswith(b"\x89PNG")
    ratios = np.array([row["ratio"] for row in rows])
    assert ratios[-1] == 1.0
    assert (ratios[:-1] > 1.0).all()
    assert ratios[1] > ratios[0] > 0.98 * ratios[2]  # each knows more of the rotors
    assert all(row["certified"] for row in rows)
    assert all(row["max_position_error_m"] < 0.02 for row in rows[:3])  # the others leave rotors no reserve
