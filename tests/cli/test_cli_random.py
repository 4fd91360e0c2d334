"""Whatever the command line: one sentence, an exit code that is documented, nothing half-written."""

from __future__ import annotations

from pathlib import Path

import pytest

from random_command_lines import command_lines, faults, fill


def test_any_command_line_ends_in_a_sentence_and_nothing_half_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    fill(tmp_path)
    wrong = {tuple(line): found for line in command_lines(100, seed=0) if (found := faults(line))}
    assert not wrong
