"""Long planning tells which planner, for how long, and how good so far; by a clock that is given."""

from __future__ import annotations

import io
import subprocess
import sys
from pathlib import Path

import pytest

from aerobat.cli.progress import PlanningProgress, period, tell
from aerobat.errors import SpecError
from aerobat.planning import Attempt


class Clock:
    """Stands still until it is set."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def attempt(duration: float, feasible: bool, outcome: str = "so") -> Attempt:
    return Attempt(duration, feasible, "optimal", outcome, None, 1, 0.0)


def test_a_line_names_the_planner_its_time_the_best_so_far_and_the_last_attempt() -> None:
    clock = Clock()
    progress = PlanningProgress("free-knots", clock)
    clock.now = 7.2
    assert str(progress) == "planning with free-knots for 7 s: no plan so far"
    for duration, feasible in ((2.5, True), (2.1, True), (1.9, False), (2.3, True)):
        progress.record(attempt(duration, feasible))
    clock.now = 61.0
    assert str(progress) == "planning with free-knots for 61 s: 2.100 s so far; attempt 4: 2.300 s, so"
    progress.tried("reserve 0.15: 97 % pass")
    said = "planning with free-knots for 61 s: round 2, no plan so far; attempt 4: 2.300 s, so"
    assert str(progress) == f"{said}; round 1, reserve 0.15: 97 % pass"
    progress.begin("miqp")
    clock.now = 63.0
    assert str(progress) == "planning with miqp for 2 s: no plan so far"


def test_lines_come_one_a_period_until_planning_ends(capsys) -> None:
    clock = Clock()
    progress = PlanningProgress("miqp", clock)

    def wait(seconds: float) -> bool:
        clock.now += seconds
        return clock.now > 17.0  # when planning ends

    tell(progress, wait, 5.0)
    lines = capsys.readouterr().err.splitlines()
    assert lines == [f"aerobat: planning with miqp for {t} s: no plan so far" for t in (5, 10, 15)]


def test_brackets_in_an_outcome_are_no_markup() -> None:
    from rich.console import Console

    progress = PlanningProgress("miqp", Clock())
    progress.record(attempt(1.0, False, "rotors[2] [/] exceed"))
    terminal = io.StringIO()
    Console(file=terminal, width=200).print(progress)
    assert "rotors[2] [/] exceed" in terminal.getvalue()


@pytest.mark.parametrize("text", ["0", "-1", "nan", "inf", "soon"])
def test_a_period_that_is_none_is_refused(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AEROBAT_PROGRESS", text)
    with pytest.raises(SpecError, match="AEROBAT_PROGRESS must be a positive number"):
        period()


@pytest.mark.process
def test_in_a_pipe_lines_come_while_a_solver_runs_and_standard_output_has_none(tmp_path: Path) -> None:
    """As often as can be: which of them come depends on the machine, that some do does not."""
    done = subprocess.run(
        [sys.executable, "-m", "aerobat", "plan", "half-flip", "--json"],
        env={"AEROBAT_PROGRESS": "1e-3", "PATH": "", "PYTHONUTF8": "1"},
        capture_output=True, text=True, cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0
    lines = done.stderr.splitlines()
    assert lines
    assert all(line.startswith("aerobat: planning with miqp for ") for line in lines)
    assert done.stdout.startswith("{")
