"""Any terminal will do, of few characters, full or closed: a run says what it can, and ends as it should.

Streams of a process are what they are from its beginning; most of what is done with them is done in this one.
"""

from __future__ import annotations

import errno
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from command_lines import code
from shared_plans import shared_plan

FULL = Path("/dev/full")
has_full = pytest.mark.skipif(not FULL.exists(), reason="the system has no full device")
TOLD = "aerobat: cannot write to standard output: No space left on device\n"


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    shared_plan("line").save("line.plan")


def of_ascii(name: str, monkeypatch: pytest.MonkeyPatch) -> io.BytesIO:
    """What is written to a standard stream of ASCII from now on."""
    written = io.BytesIO()
    monkeypatch.setattr(sys, name, io.TextIOWrapper(written, encoding="ascii", write_through=True))
    return written


@pytest.mark.parametrize("command", ["plan line.plan", "show", "plan --help"])
def test_a_terminal_of_ascii_gets_ascii(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    written = of_ascii("stdout", monkeypatch)
    assert code(*command.split()) == 0
    text = written.getvalue().decode("ascii")
    assert "\\u" not in text
    assert len(text) > 100


def test_in_ascii_json_says_what_it_says_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    Path("環.toml").write_text(
        'name = "環 loop"\nstart = { position = [0.0, 0.0, 0.0] }\ngoal = { position = [3.0, 0.0, 0.0] }\n'
        'maneuver = { kind = "line" }\n',
        encoding="utf-8",
    )
    written = of_ascii("stdout", monkeypatch)
    assert code("plan", "環.toml", "--planner", "min-snap", "--json", "--out", "here") == 0
    assert json.loads(written.getvalue().decode("ascii"))["problem"] == "環 loop"


def test_a_sentence_of_an_error_is_in_ascii_too(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    written = of_ascii("stderr", monkeypatch)
    assert code("plan", "環.toml") == 2
    assert capsys.readouterr().out == ""
    assert written.getvalue().isascii()
    assert written.getvalue().count(b"\n") == 1


@has_full
@pytest.mark.parametrize("command", ["check line.plan --json", "show", "--help"])
def test_a_full_standard_output_is_told(command: str, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    with FULL.open("w", encoding="utf-8") as full:
        monkeypatch.setattr(sys, "stdout", full)
        assert code(*command.split()) == 2
    assert capsys.readouterr().err == TOLD


@has_full
def test_a_full_standard_output_that_keeps_nothing_is_told(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    with FULL.open("wb", buffering=0) as full:
        monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(full, write_through=True))
        assert code("show") == 2
    assert capsys.readouterr().err == TOLD


@pytest.mark.parametrize("number", [errno.ECONNRESET, errno.EPIPE, errno.EMFILE])
def test_an_error_of_something_else_is_not_said_to_be_of_standard_output(
    number: int, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("aerobat.cli.app.run", refuse)
    assert code("check", "line.plan") == 2
    assert capsys.readouterr().err == f"aerobat: the operating system refused: {os.strerror(number)}\n"


@has_full
def test_a_full_standard_error_changes_no_exit_code(monkeypatch: pytest.MonkeyPatch) -> None:
    with FULL.open("w", encoding="utf-8") as full:
        monkeypatch.setattr(sys, "stderr", full)
        assert code("plan", "lime") == 2


@pytest.mark.parametrize(("command", "ended"), [("check line.plan", 0), ("plan lime", 2)])
def test_streams_that_are_not_there_change_no_exit_code(
    command: str, ended: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("stdin", "stdout", "stderr"):
        monkeypatch.setattr(sys, name, None)
    assert code(*command.split()) == ended


def shell(command: str, **environment: str) -> subprocess.CompletedProcess[bytes]:
    """A command of the shell, in which `aerobat` is this one."""
    return subprocess.run(
        ["sh", "-c", f'aerobat() {{ "{sys.executable}" -m aerobat "$@"; }}\n{command}'],
        capture_output=True,
        env={**os.environ, **environment},
    )


@pytest.mark.process
def test_a_process_whose_terminal_has_ascii_alone_writes_ascii() -> None:
    ended = shell("aerobat plan line.plan; aerobat plan 環.toml", PYTHONIOENCODING="ascii")
    assert ended.returncode == 2
    assert len(ended.stdout.decode("ascii")) > 100
    assert ended.stderr.isascii()
    assert ended.stderr.count(b"\n") == 1


@has_full
@pytest.mark.process
@pytest.mark.parametrize("command", ["plan line.plan", "--help"])
def test_a_process_whose_standard_output_is_full_tells_it_once(command: str) -> None:
    ended = shell(f"aerobat {command} > /dev/full")
    assert (ended.returncode, ended.stderr.decode()) == (2, TOLD)


@has_full
@pytest.mark.process
def test_a_process_whose_standard_error_is_full_ends_with_the_code_of_its_run() -> None:
    assert shell("aerobat plan lime 2> /dev/full").returncode == 2


@pytest.mark.process
@pytest.mark.parametrize(
    ("closed", "command", "code"),
    [
        *((closed, "plan line.plan --out kept", 0) for closed in (">&-", "2>&-", "<&-", "<&- >&- 2>&-")),
        *((closed, "plan lime", 2) for closed in ("2>&-", "<&- >&- 2>&-")),
    ],
)
def test_closed_streams_change_no_exit_code(closed: str, command: str, code: int) -> None:
    ended = shell(f"aerobat {command} {closed}")
    assert ended.returncode == code, ended.stderr
    assert b"Traceback" not in ended.stderr
    assert ended.stdout == b"" or code == 0
    if code == 0:
        report = json.loads(Path("kept/report.json").read_text())
        assert report["problem"] == "line"
