"""Commands of the README and of the commands page: each is run, one after another, in a folder of its own."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from test_commands import commands

from command_lines import code, run
from places import ROOT

# words of the commands that are not run here, each with its reason
LEFT_OUT = {
    "link": "needs an autopilot or ROS; tests/links fly both",
    "view": "stays until it is stopped, or draws a video; tests/viewer open its pages",
    "gurobi": "is another program; tests of peers call it",
    "compare": "takes minutes",
    "feasibility": "takes minutes",
    "tune": "takes minutes",
    "causes": "takes minutes",
    "course.toml": "is the reader's own file, as the next three are",
    "mine.toml --import": "is a problem here, and a vehicle's file above",
    "mine.py": "is the reader's own",
    "check path.csv": "has a problem of its own in its guide",
}
ENDS = {  # of commands that do not end with 0, as the pages say
    "--to crazyflie": 0,
    "crazyflie": 1,
    "race-7": 1,
    "--paper": 1,
    "min-snap": 1,
    "agile-qad": 2,
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder as a reader's checkout is, where the README's first command has run."""
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    assert code("fly", "flip-roll") == 0
    shutil.copy("out/flip-roll/plan.csv", "path.csv")
    return tmp_path


@pytest.mark.docs
@pytest.mark.parametrize(("page", "in_text"), [("README.md", True), ("docs/commands.md", False)])
def test_commands_of_a_page_run_in_their_order(page: str, in_text: bool, folder: Path, capsys) -> None:
    ended = {
        command: run(capsys, *command.split())[0]
        for command in commands(ROOT / page, in_text)
        if not any(words in command for words in LEFT_OUT)
    }
    assert len(ended) >= 8
    known = {command: next((n for words, n in ENDS.items() if words in command), 0) for command in ended}
    assert ended == known


@pytest.mark.docs
def test_the_report_that_the_readme_prints_is_that_of_its_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    ended, out, _ = run(capsys, "fly", "flip-roll")
    assert ended == 0
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (shown,) = (block for block in re.findall(r"^```\n(.*?)^```$", text, re.M | re.S) if "·" in block)
    assert [line.split() for line in shown.splitlines()] == [line.split() for line in out.splitlines()]
