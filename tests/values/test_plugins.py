"""A new maneuver and a new planner, written as a user would, outside the package: a file each, known by name.

Each command runs in a process of its own, for what is registered is registered in all of a process.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import aerobat as ab

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


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A user's folder with a maneuver, a problem that asks for it, and a planner."""
    for name, text in {"my_maneuver.py": MANEUVER, "mine.toml": PROBLEM, "my_planner.py": PLANNER}.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def aerobat(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """The command, run in that folder."""
    return subprocess.run(
        [sys.executable, "-m", "aerobat", *arguments],
        cwd=folder,
        env={**os.environ, "COLUMNS": "200", "MPLBACKEND": "agg", "PYTHONUTF8": "1"},
        capture_output=True,
        encoding="utf-8",
        check=False,
    )


def test_a_maneuver_of_ones_own_is_known_to_problem_files_by_its_name(folder: Path) -> None:
    done = aerobat(folder, "fly", "mine.toml", "--import", "my_maneuver.py", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    report = json.loads(done.stdout)
    assert report["plan"]["certificate"]["certified"] is True
    assert report["flight"]["outcome"] == "through_gates"
    again = aerobat(folder, "check", "out/mine/mine.plan", "--import", "my_maneuver.py")
    assert (again.returncode, again.stderr) == (0, "")


def test_without_its_file_a_maneuver_is_unknown_in_one_sentence(folder: Path) -> None:
    done = aerobat(folder, "plan", "mine.toml")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "maneuver.kind must be one of" in done.stderr
    assert not (folder / "out").exists()


def test_a_planner_of_ones_own_is_called_by_its_name_with_its_options(folder: Path) -> None:
    ours = ("--import", "my_planner.py", "--planner", "mine")
    done = aerobat(folder, "plan", "line", *ours, "--my-option", "3")
    assert (done.returncode, done.stderr) == (0, "")
    plan = ab.load_plan(folder / "out/line-mine/line.plan")
    assert (plan.planner, plan.duration) == ("mine", 3.0)
    assert plan.certified  # by plan(), for a planner that knows nothing of certificates


def test_help_lists_a_planner_of_ones_own_and_its_options(folder: Path) -> None:
    done = aerobat(folder, "plan", "--help", "--import", "my_planner.py")
    text = " ".join(done.stdout.replace("│", " ").split())
    assert done.returncode == 0
    assert "mine, One polynomial from start to goal" in text
    assert "--my-option" in text
    assert "mine: The duration in seconds. Default: 2.0." in text
    assert "--my-option" not in aerobat(folder, "plan", "--help").stdout


def test_an_option_of_one_planner_is_refused_by_another(folder: Path) -> None:
    done = aerobat(folder, "plan", "line", "--import", "my_planner.py", "--my-option", "3")
    assert done.returncode == 2
    assert done.stderr == "aerobat: --my-option is for --planner mine, not miqp; leave one of them out\n"
