"""Suites of tests: each runs its groups, a long test fails, a missing browser is told in a sentence."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from places import ROOT, TESTS
from suites import GROUPS, ROS_PYTHONS

pytestmark = pytest.mark.process
SAMPLE = "import pytest\n\ndef test_plain(): pass\n" + "".join(
    f"\n@pytest.mark.{name}\ndef test_{name}(): pass\n" for name in GROUPS
)
EITHER = "not (browser or ros)"  # slow tests and others
LONG = """
import budget, pytest

budget.LIMIT = 0.05

def work(): sum(range(20_000_000))

def test_plain(): work()

@pytest.mark.slow
def test_slow(): work()
"""

FIRST = """
import budget, functools

budget.LIMIT = 0.05

@functools.cache
def work(): sum(range(20_000_000))

def test_plain(): work()
"""


@pytest.fixture
def run(tmp_path: Path):
    """Run pytest with this suite's settings on a file of its own, with other variables of the environment."""

    def run(source: str, *options: str, **variables: str) -> tuple[int, str]:
        file = tmp_path / "test_sample.py"
        file.write_text(source)
        settings = ["-c", str(ROOT / "pyproject.toml"), "-p", "conftest", "-n", "0", "-v"]
        done = subprocess.run(
            [sys.executable, "-m", "pytest", *settings, *options, str(file)],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(TESTS)} | variables,
            capture_output=True,
            text=True,
        )
        return done.returncode, done.stdout + done.stderr

    return run


def test_the_default_suite_leaves_all_groups_out_and_a_group_is_run_when_it_is_asked_for(run) -> None:
    code, said = run(SAMPLE)
    assert code == 0, said
    assert f"1 passed, {len(GROUPS)} deselected" in said
    code, said = run(SAMPLE, "-m", "slow or peer")
    assert code == 0, said
    assert f"2 passed, {len(GROUPS) - 1} deselected" in said


def test_the_full_suite_runs_all_groups(run, tmp_path: Path) -> None:
    for program in ("chromium", "gcc", "make"):  # no test that needs one is run
        (tmp_path / program).write_text("#!/bin/sh\n")
        (tmp_path / program).chmod(0o755)
    parts = dict.fromkeys(ROS_PYTHONS.values(), sys.executable) | {"PATH": str(tmp_path)}
    code, said = run(SAMPLE, "--full", "--collect-only", **parts)
    assert code == 0, said
    assert f"{len(GROUPS) + 1} tests collected" in said


def test_an_unmarked_test_that_takes_long_twice_fails(run) -> None:
    code, said = run(LONG, "-m", EITHER)
    assert code == 1, said
    assert "1 failed, 1 passed" in said
    assert "test_plain took" in said
    assert "Shorten it, or mark it slow." in said
    assert run(LONG, "-m", EITHER, "--no-budget")[0] == 0


def test_a_test_that_pays_for_what_others_share_passes_when_it_runs_again(run) -> None:
    code, said = run(FIRST, "-m", EITHER)
    assert code == 0, said
    assert "1 passed" in said


def test_without_a_browser_its_tests_say_in_one_sentence_how_to_get_one(run, tmp_path: Path) -> None:
    code, said = run(SAMPLE, "-m", "browser", PATH=str(tmp_path))
    assert code == pytest.ExitCode.USAGE_ERROR
    assert [line for line in said.splitlines() if line] == [
        "ERROR: no browser was found, neither Chromium nor Chrome nor Edge; install one, as with "
        "`apt-get install chromium`, or leave the browser's tests out"
    ]
