"""`aerobat view`: which page is written where, and what is said where there is none."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from aerobat import cli
from command_lines import without_pictures
from shared_plans import shared_plan
from viewer_cases import dispersed, header


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run."""
    folder = tmp_path_factory.mktemp("runs") / "line"
    shared_plan("line").save(folder.parent / "line.plan")
    with pytest.MonkeyPatch.context() as patch:
        without_pictures(patch)
        cli.main(["fly", str(folder.parent / "line.plan"), "--out", str(folder)])
    return folder


@pytest.fixture
def run(kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of it to work on."""
    without_pictures(monkeypatch)
    shutil.copytree(kept, tmp_path / "line")
    return tmp_path / "line"


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The sentence with which a command line is refused."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as stop:
        cli.main(["view", *arguments])
    assert stop.value.code == 2
    out, err = capsys.readouterr()
    assert not out
    assert err.startswith("aerobat: ")
    assert err.count("\n") == 1
    return err


@pytest.mark.parametrize("name", ["", "line.plan", "flight.npz"])
def test_the_page_of_a_run_joins_its_folder_and_goes_with_it(run: Path, name: str) -> None:
    cli.main(["view", str(run / name)])
    shown = header((run / "replay.html").read_text(encoding="utf-8"))
    assert shown["title"] == "line · agile-quad"
    assert shown["curves"][0]["name"] == ("speed" if name == "line.plan" else "position error")
    if not name:
        cli.main(["plan", str(run), "--out", str(run)])  # takes the folder's place as a whole
        assert not (run / "replay.html").exists()


def test_the_page_of_another_file_lies_beside_it(run: Path, tmp_path: Path) -> None:
    shutil.copy(run / "line.plan", tmp_path / "mine.plan")
    cli.main(["view", str(tmp_path / "mine.plan")])
    dispersed().save(tmp_path / "batch.npz")  # not of the plan beside it
    cli.main(["view", str(tmp_path / "batch.npz")])
    assert header((tmp_path / "mine.html").read_text(encoding="utf-8"))["title"] == "line · agile-quad"
    batch = header((tmp_path / "batch.html").read_text(encoding="utf-8"))
    assert len(batch["tracks"]) == 50
    assert not batch["gates"]
    shared_plan("flip-roll").save(tmp_path / "mine.plan")  # of which it is
    cli.main(["view", str(tmp_path / "batch.npz"), "--html", str(tmp_path / "x" / "y.html")])
    assert header((tmp_path / "x" / "y.html").read_text(encoding="utf-8"))["gates"]


def test_machines_are_told_what_was_written(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cli.main(["view", str(run), "--json"])
    told = json.loads(capsys.readouterr().out)
    assert told["page"] == str(run / "replay.html")
    assert told["bytes"] == (run / "replay.html").stat().st_size
    assert [flight["failed"] for flight in told["flights"]] == [False]


def test_a_part_that_a_killed_view_left_does_not_keep_the_next_run_out(run: Path) -> None:
    (run / ".replay.999999999.aerobat-part.html").write_text("half a page")
    cli.main(["plan", str(run), "--out", str(run)])
    assert not list(run.glob(".*"))


def test_the_browser_is_opened_where_asked(run: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    opened = []
    monkeypatch.setattr("webbrowser.open", lambda address: not opened.append(address))
    cli.main(["view", str(run), "--open"])
    assert opened == [(run / "replay.html").as_uri()]
    monkeypatch.setattr("webbrowser.open", lambda address: False)
    cli.main(["view", str(run), "--open"])
    assert "no browser could be started" in capsys.readouterr().err


def test_what_cannot_be_shown_is_refused_in_a_sentence(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "no such file or folder" in refused(capsys, "flip-roll")
    assert "holds a path alone" in refused(capsys, str(run / "plan.csv"))
    assert "no replay" in refused(capsys, str(run), "--html", str(run / "plan.csv"))
    assert "hexarotor has 6" in refused(capsys, str(run), "--vehicle", "hexarotor")
    assert "--speed is for --video" in refused(capsys, str(run), "--speed", "1")
    assert "--speed is for --video" in refused(capsys, "line", "--live", "--speed", "1")
    content = dict(np.load(run / "flight.npz"))
    content["position"] = content["position"].copy()
    content["position"][100, 1] = np.nan
    np.savez(run / "flight.npz", **content)
    assert "position" in refused(capsys, str(run))
    assert not (run / "replay.html").exists()


def test_of_a_sweep_its_own_first_flights_are_shown(run: Path, tmp_path: Path, capsys) -> None:
    """The errors that the page is told are those of the sweep's table."""
    swept = tmp_path / "swept"
    (tmp_path / "weak.toml").write_text("mass = 0.03\n")
    flights = ["--conditions", str(tmp_path / "weak.toml"), "--runs", "3", "--seed", "5", "--workers", "1"]
    cli.main(["sweep", str(run), *flights, "--out", str(swept)])
    capsys.readouterr()
    cli.main(["view", str(swept), "--json"])
    told = json.loads(capsys.readouterr().out)["flights"]
    rows = (swept / "flights.csv").read_text(encoding="utf-8").splitlines()
    column = rows[0].split(",").index("max_position_error_m")
    errors = [float(row.split(",")[column]) for row in rows[1:]]
    assert len(told) == len(errors) == 3
    for flight, error in zip(told, errors, strict=True):
        assert f"{100 * error:.2f} cm off its path" in flight["sentence"]
