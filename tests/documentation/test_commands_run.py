"""Commands that pages show: each is run, one after another, in a folder of the page's own."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from test_commands import PAGES, commands

from command_lines import code, run
from places import ROOT

# words of the commands that are not run here, each with its reason
LEFT_OUT = {
    "link": "needs an autopilot or ROS; tests/links fly both",
    "--autopilot": "needs the firmware; tests/links fly it",
    "view": "stays until it is stopped, or draws a video; tests/viewer open its pages",
    "gurobi": "is another program; tests of peers call it",
    "compare": "takes minutes",
    "feasibility": "takes minutes",
    "tune": "takes minutes",
    "causes": "takes minutes",
    "half-flip-map": "repeats what takes minutes",
    "course.toml": "is the reader's own file, as those that follow are",
    "mine.toml --import": "is a problem here, and a vehicle's file above",
    "--vehicle mine.toml": "is the reader's own",
    "show mine.toml": "is the reader's own",
    "mine.py": "is the reader's own",
    "my_law.py": "is the reader's own",
    "iris.sdf": "is the reader's own",
    "weak.toml": "is the reader's own",
    "log.npz": "is the reader's own",
}
ENDS = {  # of commands that do not end with 0, as the pages say
    "--to crazyflie": 0,
    "fly flip-roll --vehicle crazyflie": 0,
    "fly flip-pitch --vehicle crazyflie": 0,
    "crazyflie": 1,
    "--paper": 1,
    "min-snap": 1,
    "fast-half-flip": 1,
    "--reserve 0": 1,
    "--max-speed 8": 1,
    "agile-qad": 2,
}
EITHER_WAY = "two-flips"  # of whose flights about 95 % succeed, so that chance says whether it ends with 0
IN_TEXT = "README.md"  # the page whose text is read for commands, too


def run_here(page: Path) -> list[str]:
    """Return the commands of a page that are run, in their order."""
    shown = commands(page, page.name == IN_TEXT)
    return [each for each in dict.fromkeys(shown) if not any(words in each for words in LEFT_OUT)]


RUN = {str(page.relative_to(ROOT)): run_here(page) for page in PAGES if run_here(page)}


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder as a reader's checkout is, where the README's first command has run."""
    folder = tmp_path_factory.mktemp("checkout")
    shutil.copytree(ROOT / "examples", folder / "examples")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert code("fly", "flip-roll") == 0
        assert code("plan", "half-flip") == 0
    shutil.copy(folder / "out" / "flip-roll" / "plan.csv", folder / "path.csv")
    return folder


@pytest.fixture
def folder(checkout: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A checkout of the page's own."""
    shutil.copytree(checkout, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.docs
@pytest.mark.parametrize("page", RUN)
def test_commands_of_a_page_run_in_their_order(page: str, folder: Path, capsys) -> None:
    ended = {command: run(capsys, *command.split())[0] for command in RUN[page]}
    known = {command: next((n for words, n in ENDS.items() if words in command), 0) for command in ended}
    known |= {command: end for command, end in ended.items() if EITHER_WAY in command and end in (0, 1)}
    assert ended == known


def test_most_pages_that_show_commands_are_run() -> None:
    assert len(RUN) >= 12
