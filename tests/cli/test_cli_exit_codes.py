"""Exit codes say how a run went: all well, not well, bad input, no plan, interrupted."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

import aerobat as ab
from aerobat import cli
from aerobat.cli.failures import ExitCode
from command_lines import code, without_pictures
from places import ROOT
from shared_plans import shared_plan

# the paper's program as it is, whose body rates jump, which no moment can do
JERK = ab.Miqp(order=3, search=ab.BisectionSearch())


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    without_pictures(monkeypatch)


@pytest.mark.parametrize("command", [["fly", "line.plan"], ["check", "line.plan"], ["show"], ["--help"]])
def test_what_went_well_exits_with_0(command: list[str]) -> None:
    shared_plan("line").save("line.plan")
    assert code(*command) == 0


@pytest.mark.parametrize(
    ("command", "written"),
    [pytest.param("plan", "report.json", marks=pytest.mark.slow), ("fly", "flight.npz"), ("check", "")],
)
def test_a_plan_that_is_not_certified_exits_with_1_and_is_written(command: str, written: str) -> None:
    shared_plan("line", planner=JERK).save("jerk.plan")
    options = ["--out", "jerk"] if written else []
    assert code(command, "jerk.plan", *options) == 1
    assert not written or Path("jerk", written).exists()


def test_an_export_of_a_plan_that_is_not_certified_warns_and_exits_with_1(capsys) -> None:
    for plan, expected in ((shared_plan("line", planner=JERK), 1), (shared_plan("line"), 0)):
        plan.save("line.plan")
        assert code("export", "line.plan", "--to", "csv", "--out", "line.csv") == expected
        assert Path("line.csv").exists()
        assert ("warning: the plan is not certified for agile-quad" in capsys.readouterr().err) == expected


def test_a_flight_that_went_wrong_exits_with_1_and_is_written(monkeypatch) -> None:
    from aerobat.evaluation import score

    def fallen(*arguments: object):
        return replace(score(*arguments), ground_time=0.5)

    monkeypatch.setattr("aerobat.cli.commands.fly.score", fallen)
    shared_plan("line").save("line.plan")
    assert code("fly", "line.plan", "--out", "missed") == 1
    assert Path("missed/flight.npz").exists()


def test_a_certified_plan_that_does_not_fly_exits_with_1() -> None:
    slow = replace(ab.Controller.paper(), attitude_frequency=12.0)
    plan = shared_plan("half-flip").for_vehicle(replace(ab.load_vehicle("agile-quad"), controller=slow))
    assert plan.certified
    assert not plan.flies
    plan.save("crashing.plan")
    assert code("plan", "crashing.plan", "--out", "again") == 1
    assert Path("again/half-flip.plan").exists()


def test_bad_input_exits_with_2_and_no_plan_with_3() -> None:
    assert code("fly", "lime") == 2
    Path("hard.toml").write_text(
        'name = "hard"\nstart = { position = [0.0, 0.0, 0.0] }\ngoal = { position = [0.0, 0.0, 0.0] }\n'
        "gate = { position = [0.0, 0.0, 5.0], tilt_deg = 180.0 }\n"
        "maneuver = { kind = 'flip', min_inverted_thrust = 45.0 }\n"
    )
    assert code("plan", "hard.toml") == 3
    assert not list(Path().glob("out*"))


def test_every_code_is_documented(capsys) -> None:
    page = (ROOT / "docs" / "commands.md").read_text()
    rows = re.findall(r"^\| ([\d, ]+) \| ", page.partition("## Exit codes")[2], re.MULTILINE)
    cli.main(["--help"])
    helped = " ".join(capsys.readouterr().out.replace("│", "").split())
    codes = re.search(r"Exit codes:(.*?)nothing\s*written", helped)
    assert codes is not None
    for told in (", ".join(rows).split(", "), re.findall(r"(?:^|; ?)\s*`?(\d+)`? ", codes[1])):
        assert set(map(int, told)) == {each.value for each in ExitCode} - {ExitCode.BROKEN_PIPE}
