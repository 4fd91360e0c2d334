"""A maneuver and a planner of one's own, written as a user would: a file each, known by their names."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import aerobat as ab
from command_lines import run, without_pictures

MANEUVER = '''
from collections.abc import Sequence

import aerobat as ab
from aerobat.declaration import Positive
from aerobat.problem import GatePassage, StageSequence


@ab.maneuver("knife-edge")
class KnifeEdge(ab.Maneuver):
    """Through a gate with the thrust horizontal, to the left of the passage."""

    min_thrust: Positive = 8.0  # [m/s²]

    def stage_sequence(self, gates: Sequence[ab.Gate], max_specific_thrust: float) -> StageSequence:
        """Return one stage, the gate's."""
        conditions = (
            ab.Condition("specific_thrust", (0.0, 0.0, 1.0), lower=0.0, upper=0.0),
            ab.Condition("specific_thrust", gates[0].lateral, lower=self.min_thrust),
        )
        return StageSequence((GatePassage().stage(gates[0], conditions),))
'''
PROBLEM = """
name = "mine"
start.position = [0.0, 0.0, 0.0]
goal.position = [6.0, 0.0, 0.0]
gate.position = [3.0, 0.0, 1.0]
maneuver = { kind = "knife-edge", min_thrust = 9.0 }
"""
PLANNER = '''
from dataclasses import dataclass

import numpy as np

import aerobat as ab


@ab.planner("mine")
@dataclass(frozen=True)
class Straight:
    """One polynomial from start to goal that takes as long as it is told to."""

    my_option: float = ab.option(2.0, "The duration in seconds.")

    def plan(self, problem, vehicle=None, progress=None):
        """Return the plan."""
        ends = np.stack([problem.start.derivatives(5), problem.goal.derivatives(5)])
        return ab.Plan(problem, ab.minimum_effort(ends, [self.my_option]), "mine")
'''


OURS = ("--import", "my_planner.py", "--planner", "mine")


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A user's folder with a maneuver, a problem that asks for it, and a planner."""
    monkeypatch.chdir(tmp_path)
    without_pictures(monkeypatch)
    for name, value in {"COLUMNS": "200", "MPLBACKEND": "agg", "PYTHONUTF8": "1"}.items():
        monkeypatch.setenv(name, value)
    for name, text in {"my_maneuver.py": MANEUVER, "mine.toml": PROBLEM, "my_planner.py": PLANNER}.items():
        Path(name).write_text(text, encoding="utf-8")


def test_a_maneuver_of_ones_own_is_known_to_problem_files_by_its_name(capsys) -> None:
    code, out, err = run(capsys, "fly", "mine.toml", "--import", "my_maneuver.py", "--json")
    assert (code, err) == (0, "")
    report = json.loads(out)
    assert report["plan"]["certificate"]["certified"] is True
    assert report["flight"]["outcome"] == "through_gates"


def test_without_its_file_a_maneuver_is_unknown_in_one_sentence(capsys) -> None:
    code, _, err = run(capsys, "plan", "mine.toml")
    assert code == 2
    assert err.count("\n") == 1
    assert "maneuver.kind must be one of" in err
    assert not Path("out").exists()


def aerobat(*arguments: str) -> tuple[int, str, str]:
    """What the command comes to in a process of its own, in which options are made but once."""
    done = subprocess.run(
        [sys.executable, "-m", "aerobat", *arguments], capture_output=True, encoding="utf-8", check=False
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.process
def test_a_plan_for_a_maneuver_of_ones_own_is_read_by_another_process_that_knows_it() -> None:
    mine = ("--import", "my_maneuver.py")
    for arguments in (("plan", "mine.toml"), ("check", "out/mine/mine.plan")):
        code, _, err = aerobat(*arguments, *mine)
        assert (code, err) == (0, "")


@pytest.mark.process
def test_a_planner_of_ones_own_is_called_by_its_name_with_its_options() -> None:
    code, _, err = aerobat("plan", "line", *OURS, "--my-option", "3")
    assert (code, err) == (0, "")
    plan = ab.load_plan(next(Path("out").rglob("line.plan")))
    assert (plan.planner, plan.duration) == ("mine", 3.0)
    assert plan.certified  # by plan(), for a planner that knows nothing of certificates


@pytest.mark.process
def test_help_lists_a_planner_of_ones_own_and_its_options() -> None:
    code, out, _ = aerobat("plan", "--help", "--import", "my_planner.py")
    text = " ".join(out.replace("│", " ").split())
    assert code == 0
    assert "mine: One polynomial from start to goal" in text
    assert "--my-option" in text
    assert "mine: The duration in seconds. Default: 2.0." in text
    assert "--my-option" not in aerobat("plan", "--help")[1]


@pytest.mark.process
def test_an_option_of_one_planner_is_refused_by_another() -> None:
    code, _, err = aerobat("plan", "line", "--import", "my_planner.py", "--my-option", "3")
    assert code == 2
    assert err == "aerobat: --my-option is for --planner mine, not miqp; leave one of them out\n"


def test_a_plugin_leaves_no_bytecode_beside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    file = tmp_path / "alone" / "plugin.py"
    file.parent.mkdir()
    file.write_text("")
    ab.import_plugin(file)
    assert list(file.parent.iterdir()) == [file]
