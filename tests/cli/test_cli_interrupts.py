"""Ctrl-C ends a run at any instant with exit code 130 and a word, and nothing is written.

The instants are those of what a process has done: it sends itself the signal when a function is called.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from aerobat import cli
from command_lines import run, without_pictures
from shared_plans import shared_plan

INTERRUPTED = (130, "", "aerobat: interrupted\n")
# sends SIGINT to itself when Python calls a function of this name for the nth time, then runs the command
INTERRUPTED_AT = """
import os, signal, sys
function, left, command = sys.argv[1], int(sys.argv[2]), sys.argv[3:]

def watch(frame, event, argument):
    global left
    if event == "call" and frame.f_code.co_name == function:
        left -= 1
        if left == 0:
            sys.setprofile(None)
            os.kill(os.getpid(), signal.SIGINT)

sys.argv = ["aerobat", *command]
from aerobat.cli import main
sys.setprofile(watch)
main()
"""
# what is called on the way: before anything is imported, options read, a plan searched, flown, drawn, written
ON_THE_WAY = [
    ("provide_streams", 1, "line"),
    ("_find_and_load", 5, "line"),
    ("_find_and_load", 400, "line"),
    ("cb", 100, "line"),  # a weak reference's callback to what imports, from which Python can raise nothing
    ("import_plugin", 1, "line"),
    ("read_task", 1, "line"),
    ("certified_solve", 1, "line"),
    ("score", 1, "line.plan"),
    (
        "__array__",
        1,
        "line.plan",
    ),  # which Matplotlib calls from C++, and takes what it raises for a wrong value
    ("write_columns", 1, "line.plan"),
    ("end_interrupts", 1, "line.plan"),
]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The working folder of a command within this process, which forgets the plugins that it imports."""
    monkeypatch.chdir(tmp_path)
    without_pictures(monkeypatch)
    known = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - known:
        if name.startswith("aerobat_plugin_"):
            del sys.modules[name]


def interrupted(function: str, nth: int, *command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", INTERRUPTED_AT, function, str(nth), *command],
        capture_output=True,
        text=True,
        cwd=folder,
    )


@pytest.mark.process
@pytest.mark.parametrize(("function", "nth", "problem"), ON_THE_WAY)
def test_an_interrupt_on_the_way_leaves_nothing_but_a_word(
    function: str, nth: int, problem: str, tmp_path: Path
) -> None:
    (tmp_path / "plugin.py").write_text("")
    shared_plan("line").save(tmp_path / "line.plan")
    ended = interrupted(function, nth, "fly", problem, "--import", "plugin.py", folder=tmp_path)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "aerobat: interrupted\n")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["line.plan", "plugin.py"]


@pytest.mark.parametrize("function", ["commands.fly.score", "runs.folder.write_columns"])
def test_an_interrupt_of_a_command_within_another_program_leaves_nothing_but_a_word(
    function: str, here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shared_plan("line").save("line.plan")
    monkeypatch.setattr(f"aerobat.cli.{function}", lambda *_: signal.raise_signal(signal.SIGINT))
    assert run(capsys, "fly", "line.plan") == INTERRUPTED
    assert not [path for path in here.rglob("*") if path.name not in ("line.plan", "out")]


@pytest.mark.process
@pytest.mark.parametrize(("nth", "planner"), [(3, "time-optimal")])
def test_an_interrupt_of_a_refinement_is_no_result(nth: int, planner: str, tmp_path: Path) -> None:
    command = ("plan", "half-flip", "--planner", *planner.split())
    ended = interrupted("interior_point", nth, *command, folder=tmp_path)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "aerobat: interrupted\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.process
def test_a_comparison_that_is_interrupted_has_no_rows(tmp_path: Path) -> None:
    ended = interrupted("interior_point", 2, "compare", "line", folder=tmp_path)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "aerobat: interrupted\n")
    assert not list(tmp_path.iterdir())


def test_an_interrupt_comes_too_late_once_all_is_written(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shared_plan("line").save("line.plan")
    monkeypatch.setattr(
        "aerobat.cli.runs.folder.print_table", lambda table: signal.raise_signal(signal.SIGINT)
    )
    code, _, err = run(capsys, "plan", "line.plan", "--out", "kept")
    assert (code, err) == (0, "")
    assert json.loads((here / "kept" / "report.json").read_text())["problem"] == "line"


def test_an_interrupt_that_is_swallowed_on_the_way_still_ends_the_run(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As where Python calls back from somewhere that can raise nothing."""
    Path("plugin.py").write_text(
        "import signal\ntry:\n    signal.raise_signal(signal.SIGINT)\nexcept KeyboardInterrupt:\n    pass\n"
    )
    shared_plan("line").save("line.plan")
    assert run(capsys, "plan", "line.plan", "--import", "plugin.py", "--out", "kept") == INTERRUPTED
    assert sorted(path.name for path in here.iterdir()) == ["line.plan", "plugin.py"]


# classes of which Python calls something when an object dies, and takes no exception from it
CALLED_WHEN_IT_DIES = {
    "__del__": """
class Dying:
    def __del__(self):
        on_death()
""",
    "weakref": """
import weakref
class Dying:
    def __init__(self):
        self.watch = weakref.finalize(self, on_death)
""",
    "in turn": """
class Inner:
    def __del__(self):
        on_death()
class Dying:
    def __del__(self):
        inner = Inner()
        del inner
        print("unreachable")
""",
}


def dying_plugin(dying: str, on_death: str) -> str:
    """A plugin that lets an object die, then prints."""
    begin = f"import signal\ndef on_death():\n    {on_death}\n{CALLED_WHEN_IT_DIES[dying]}"
    return begin + "it = Dying()\ndel it\nprint('went on')\n"


@pytest.mark.parametrize("dying", CALLED_WHEN_IT_DIES)
def test_an_interrupt_that_python_cannot_raise_where_it_comes_is_raised_right_after(
    dying: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("plugin.py").write_text(dying_plugin(dying, "signal.raise_signal(signal.SIGINT)"))
    assert run(capsys, "plan", "line", "--import", "plugin.py") == INTERRUPTED
    assert [path.name for path in here.iterdir()] == ["plugin.py"]


@pytest.mark.process
def test_another_exception_that_python_cannot_raise_is_told_as_ever(tmp_path: Path) -> None:
    (tmp_path / "plugin.py").write_text(dying_plugin("__del__", "raise ValueError('a defect')"))
    shared_plan("line").save(tmp_path / "line.plan")
    ended = subprocess.run(
        [sys.executable, "-m", "aerobat", "check", "line.plan", "--import", "plugin.py"],
        capture_output=True, text=True, cwd=tmp_path,
    )  # fmt: skip
    assert ended.returncode == 0
    assert ended.stdout.startswith("went on\n")
    assert ended.stderr.startswith("Exception ignored in")
    assert "ValueError: a defect" in ended.stderr


def test_a_run_within_another_program_leaves_signals_and_hooks_as_they_were(here: Path) -> None:
    shared_plan("line").save("line.plan")
    before = signal.getsignal(signal.SIGINT), sys.unraisablehook, sys.getprofile()
    cli.main(["check", "line.plan"])
    assert (signal.getsignal(signal.SIGINT), sys.unraisablehook, sys.getprofile()) == before


def test_the_word_is_said_where_standard_error_was_even_if_it_is_led_elsewhere_by_then(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As where Ctrl-C comes while what a solver printed is being put back."""
    lead = "import io, signal, sys\nsys.stderr = io.StringIO()\nsignal.raise_signal(signal.SIGINT)\n"
    Path("plugin.py").write_text(lead)
    assert run(capsys, "plan", "line", "--import", "plugin.py") == INTERRUPTED
