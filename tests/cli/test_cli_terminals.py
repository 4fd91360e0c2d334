"""Any terminal will do, of few characters, full or closed: a run says what it can, and ends as it should."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest


def shell(command: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[bytes]:
    """A command of the shell, in which `aerobat` is this one."""
    return subprocess.run(
        ["sh", "-c", f'aerobat() {{ "{sys.executable}" -m aerobat "$@"; }}\n{command}'],
        cwd=folder,
        capture_output=True,
        env={**os.environ, **environment},
    )


@pytest.mark.parametrize("command", ["plan line --order 5", "vehicles", "problems", "plan --help"])
def test_a_terminal_of_ascii_gets_ascii(command: str, tmp_path: Path) -> None:
    ended = shell(f"aerobat {command}", tmp_path, PYTHONIOENCODING="ascii")
    assert (ended.returncode, ended.stderr) == (0, b"")
    text = ended.stdout.decode("ascii")
    assert "\\u" not in text
    assert len(text) > 100


def test_in_ascii_json_says_what_it_says_elsewhere(tmp_path: Path) -> None:
    (tmp_path / "環.toml").write_text(
        'name = "環 loop"\nstart = { position = [0.0, 0.0, 0.0] }\ngoal = { position = [3.0, 0.0, 0.0] }\n'
        'maneuver = { kind = "line" }\n',
        encoding="utf-8",
    )
    ended = shell("aerobat plan 環.toml --order 5 --json --out here", tmp_path, PYTHONIOENCODING="ascii")
    assert (ended.returncode, ended.stderr) == (0, b"")
    assert json.loads(ended.stdout.decode("ascii"))["problem"] == "環 loop"


def test_a_sentence_of_an_error_is_in_ascii_too(tmp_path: Path) -> None:
    ended = shell("aerobat plan 環.toml", tmp_path, PYTHONIOENCODING="ascii")
    assert ended.returncode == 2
    assert ended.stdout == b""
    assert ended.stderr.isascii()
    assert ended.stderr.count(b"\n") == 1


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no full device")
@pytest.mark.parametrize(
    "command", ["plan line --order 5", "plan line --order 5 --json", "vehicles", "--help"]
)
def test_a_full_standard_output_is_told(command: str, tmp_path: Path) -> None:
    ended = shell(f"aerobat {command} > /dev/full", tmp_path)
    assert ended.returncode == 2
    assert ended.stderr == b"aerobat: cannot write to standard output: No space left on device\n"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no full device")
@pytest.mark.parametrize(("command", "code"), [("plan lime", 2), ("plan line --order 5", 0)])
def test_a_full_standard_error_changes_no_exit_code(command: str, code: int, tmp_path: Path) -> None:
    assert shell(f"aerobat {command} 2> /dev/full", tmp_path).returncode == code


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&-", ">&- 2>&-", "<&- >&- 2>&-"])
@pytest.mark.parametrize(("command", "code"), [("plan line --order 5", 0), ("plan lime", 2)])
def test_closed_streams_change_no_exit_code(closed: str, command: str, code: int, tmp_path: Path) -> None:
    ended = shell(f"aerobat {command} {closed}", tmp_path)
    assert ended.returncode == code, ended.stderr
    assert b"Traceback" not in ended.stderr
    assert ended.stdout == b"" or code == 0
    if code == 0:
        report = json.loads((tmp_path / "out/line/report.json").read_text())
        assert report["problem"] == "line"


@pytest.mark.parametrize("intervals", ["10000", "3000"])
def test_a_program_too_large_for_any_memory_is_refused_in_words(intervals, tmp_path: Path) -> None:
    ended = subprocess.run(
        [sys.executable, "-m", "aerobat", "plan", "line", "--intervals", intervals],
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    assert (ended.returncode, ended.stdout) == (2, "")
    assert "intervals" in ended.stderr
    assert ended.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())
