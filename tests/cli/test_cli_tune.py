"""`aerobat tune`: better gains are written, others are not, and nothing of a search that was ended."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import pytest

import aerobat as ab
from aerobat import cli
from aerobat.cli.progress import Progress
from aerobat.problem.files import PROBLEMS
from aerobat.studies.tune import TUNED
from shared_plans import shared_plan

FEW = ("--conditions", "weak.toml", "--flights", "10", "--evaluations")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a detuned vehicle and weak conditions."""
    monkeypatch.chdir(tmp_path)
    usual = ab.Controller()
    weak = replace(usual, **{name: 0.4 * getattr(usual, name) for name in TUNED})
    ab.write_vehicle(replace(ab.load_vehicle("agile-quad"), name="slow", controller=weak), "slow.toml")
    ab.write_dispersion(ab.Dispersion(mass=0.03, start_position=0.02), "weak.toml")
    shared_plan("half-flip", "agile-quad", ab.Miqp(order=4, reserve=0.15)).save("half-flip.plan")
    return tmp_path


def test_better_gains_are_written_and_flown_by(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cli.main(["tune", "half-flip.plan", "--vehicle", "slow.toml", *FEW, "32", "--json"])
    facts = json.loads(capsys.readouterr().out)
    assert facts["better"]
    assert facts["fresh"]["after"]["cost_m"] < facts["fresh"]["before"]["cost_m"]
    assert facts["cost_change_m"]["high"] < 0.0
    written = ab.load_vehicle(Path(facts["file"]))
    assert facts["file"] == os.path.join("out", "slow-tuned.toml")
    for name, values in facts["gains"].items():
        assert getattr(written.controller, name) == values["after"]
    assert replace(written, controller=ab.Controller()) == replace(ab.load_vehicle("agile-quad"), name="slow")


def test_gains_that_are_no_better_are_not_written(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["tune", "half-flip.plan", "--vehicle", "slow.toml", *FEW, "1", "--out", "x.toml"]
    with pytest.raises(SystemExit) as stop:
        cli.main(command)
    assert stop.value.code == 1
    out, err = capsys.readouterr()
    assert "no better on fresh flights" in out
    assert err == "aerobat: nothing is written\n"
    assert not (folder / "x.toml").exists()


def test_an_interrupted_search_writes_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(self: Progress, done: int, note: str) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Progress, "tell", interrupt)
    before = sorted(folder.iterdir())
    with pytest.raises(SystemExit) as stop:
        cli.main(["tune", "half-flip.plan", "--vehicle", "slow.toml", *FEW, "20"])
    assert stop.value.code == 130
    assert sorted(folder.iterdir()) == before


def test_what_is_no_vehicles_file_is_not_replaced_by_one(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    problem = PROBLEMS.text("line")
    Path("mine.toml").write_text(problem)
    Path("folder.toml").mkdir()
    for place in ("mine.toml", "folder.toml"):
        with pytest.raises(SystemExit) as stop:
            cli.main(["tune", "half-flip.plan", "--out", place])
        assert stop.value.code == 2
        assert "is there already, and no vehicle's file; name another" in capsys.readouterr().err
    assert Path("mine.toml").read_text() == problem


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ([], "a problem is missing"),
        (["half-flip", "--out", "tuned"], "--out must be a vehicle's file, its name ending in .toml"),
        (["half-flop"], "no problem named 'half-flop'; did you mean 'half-flip'"),
        (["half-flip", "--conditions", "lba"], "no conditions named 'lba'; did you mean 'lab'"),
        (["half-flip", "--flights", "1"], 'Invalid value "1" for --flights. Must be >= 2.'),
    ],
)
def test_wrong_command_lines_end_in_a_sentence(
    folder: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], complaint: str
) -> None:
    with pytest.raises(SystemExit) as stop:
        cli.main(["tune", *arguments])
    assert stop.value.code == 2
    out, err = capsys.readouterr()
    assert not out
    assert complaint in err
    assert err.count("\n") == 1
