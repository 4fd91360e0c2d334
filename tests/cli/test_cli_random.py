"""Whatever the command line: one sentence, an exit code that is documented, nothing half-written."""

from __future__ import annotations

import shutil
from itertools import islice
from pathlib import Path

import pytest

from aerobat.interchange.csv import read_csv
from aerobat.planning import load_plan
from aerobat.simulation import load_flight
from random_command_lines import command_lines, faults, fill


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files that the command lines name."""
    folder = tmp_path_factory.mktemp("filled")
    fill(folder)
    return folder


def test_runs_and_paths_that_command_lines_name_are_whole(filled: Path) -> None:
    assert len(read_csv(filled / "path.csv").knots) > 2
    assert (
        load_flight(filled / "kept" / "flight.npz").times[-1]
        == load_plan(filled / "kept" / "line.plan").duration
    )


@pytest.mark.parametrize(
    ("begin", "end"),
    [(0, 12), pytest.param(12, 80, marks=pytest.mark.slow)],  # of the later ones some are right, and plan
)
def test_any_command_line_ends_in_a_sentence_and_nothing_half_written(
    begin: int, end: int, filled: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(shutil.copytree(filled, tmp_path / "here"))
    lines = islice(command_lines(100, seed=0), begin, end)
    wrong = {tuple(line): found for line in lines if (found := faults(line))}
    assert not wrong
