"""Ctrl-C ends a run at any instant with exit code 130 and a word, and nothing is written.

The instants are those of what a process has done: it sends itself the signal when a function is called.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

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
    ("provide_streams", 1),
    ("_run", 1),
    ("_find_and_load", 5),
    ("_find_and_load", 400),
    ("import_plugin", 1),
    ("read_task", 1),
    ("load_vehicle", 1),
    ("certified_solve", 1),
    ("certified_solve", 3),
    ("certify", 1),
    ("nominal_flight", 1),
    ("score", 1),
    ("report_figure", 1),
    ("write_columns", 1),
    ("png", 1),
    ("__array__", 1),  # which Matplotlib calls from C++, and takes what it raises for a wrong value
    ("cb", 1),  # a weak reference's callback to what imports, from which Python can raise nothing
    ("cb", 100),
    ("end_interrupts", 1),
]


def interrupted(function: str, nth: int, *command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", INTERRUPTED_AT, function, str(nth), *command],
        capture_output=True,
        text=True,
        cwd=folder,
    )


@pytest.mark.parametrize(("function", "nth"), ON_THE_WAY)
def test_an_interrupt_on_the_way_leaves_nothing_but_a_word(function: str, nth: int, tmp_path: Path) -> None:
    (tmp_path / "plugin.py").write_text("")
    ended = interrupted(function, nth, "fly", "flip-roll", "--import", "plugin.py", folder=tmp_path)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "aerobat: interrupted\n")
    assert [path.name for path in tmp_path.iterdir()] == ["plugin.py"]


@pytest.mark.parametrize(
    ("nth", "planner"),
    [
        (1, "free-knots"),
        (
            2,
            "free-knots --segments 8",
        ),  # has a certified plan of fewer segments before it, which does not count
        (1, "time-optimal"),
        (3, "time-optimal"),
    ],
)
def test_an_interrupt_of_a_nonlinear_solve_is_no_result(nth: int, planner: str, tmp_path: Path) -> None:
    pytest.importorskip("casadi")
    command = ("plan", "half-flip", "--planner", *planner.split())
    ended = interrupted("solve_nonlinear", nth, *command, folder=tmp_path)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "aerobat: interrupted\n")
    assert not list(tmp_path.iterdir())


def test_a_comparison_that_is_interrupted_has_no_rows(tmp_path: Path) -> None:
    pytest.importorskip("casadi")
    ended = interrupted("solve_nonlinear", 2, "compare", "line", folder=tmp_path)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "aerobat: interrupted\n")
    assert not list(tmp_path.iterdir())


def test_an_interrupt_comes_too_late_once_all_is_written(tmp_path: Path) -> None:
    ended = interrupted("print_table", 1, "fly", "line", "--order", "5", folder=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert json.loads((tmp_path / "out/line/report.json").read_text())["problem"] == "line"


def test_an_interrupt_that_is_swallowed_on_the_way_still_ends_the_run(tmp_path: Path) -> None:
    """As where Python calls back from somewhere that can raise nothing."""
    swallow = (
        "import signal\ntry:\n    signal.raise_signal(signal.SIGINT)\nexcept KeyboardInterrupt:\n    pass\n"
    )
    (tmp_path / "plugin.py").write_text(swallow)
    ended = subprocess.run(
        [sys.executable, "-m", "aerobat", "plan", "line", "--import", "plugin.py"],
        capture_output=True, text=True, cwd=tmp_path,
    )  # fmt: skip
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "aerobat: interrupted\n")
    assert [path.name for path in tmp_path.iterdir()] == ["plugin.py"]


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


def death_in_a_plugin(dying: str, on_death: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """A run whose plugin lets an object die, then prints."""
    plugin = f"import signal\ndef on_death():\n    {on_death}\n{CALLED_WHEN_IT_DIES[dying]}"
    (folder / "plugin.py").write_text(plugin + "it = Dying()\ndel it\nprint('went on')\n")
    return subprocess.run(
        [sys.executable, "-m", "aerobat", "plan", "line", "--import", "plugin.py"],
        capture_output=True, text=True, cwd=folder,
    )  # fmt: skip


@pytest.mark.parametrize("dying", CALLED_WHEN_IT_DIES)
def test_an_interrupt_that_python_cannot_raise_where_it_comes_is_raised_right_after(
    dying: str, tmp_path: Path
) -> None:
    ended = death_in_a_plugin(dying, "signal.raise_signal(signal.SIGINT)", tmp_path)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "aerobat: interrupted\n")
    assert [path.name for path in tmp_path.iterdir()] == ["plugin.py"]


def test_another_exception_that_python_cannot_raise_is_told_as_ever(tmp_path: Path) -> None:
    ended = death_in_a_plugin("__del__", "raise ValueError('a defect')", tmp_path)
    assert ended.returncode == 0
    assert ended.stdout.startswith("went on\n")
    assert ended.stderr.startswith("Exception ignored in")
    assert "ValueError: a defect" in ended.stderr


def test_a_run_within_another_program_leaves_signals_and_hooks_as_they_were(
    tmp_path: Path, monkeypatch
) -> None:
    from aerobat.cli import main

    monkeypatch.chdir(tmp_path)
    before = signal.getsignal(signal.SIGINT), sys.unraisablehook, sys.getprofile()
    main(["plan", "line", "--order", "5"])
    assert (signal.getsignal(signal.SIGINT), sys.unraisablehook, sys.getprofile()) == before


def test_the_word_is_said_where_standard_error_was_even_if_it_is_led_elsewhere_by_then(
    tmp_path: Path,
) -> None:
    """As where Ctrl-C comes while what a solver printed is being put back."""
    lead = "import io, signal, sys\nsys.stderr = io.StringIO()\nsignal.raise_signal(signal.SIGINT)\n"
    (tmp_path / "plugin.py").write_text(lead)
    ended = subprocess.run(
        [sys.executable, "-m", "aerobat", "plan", "line", "--import", "plugin.py"],
        capture_output=True, text=True, cwd=tmp_path,
    )  # fmt: skip
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "aerobat: interrupted\n")
