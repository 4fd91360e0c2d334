"""`aerobat export`: what is written where, what is said of its loss, and what is refused in a sentence."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

import aerobat as ab
from aerobat import cli
from aerobat.interchange.exports import FORMATS
from shared_plans import shared_plan


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run."""
    folder = tmp_path_factory.mktemp("runs") / "line"
    folder.mkdir()
    shared_plan("line").save(folder / "line.plan")
    return folder


@pytest.mark.parametrize("to", FORMATS)
def test_a_runs_plan_is_exported_to_every_format_and_its_loss_said(
    to: str, kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    capsys.readouterr()
    cli.main(["export", str(kept), "--to", to, "--json"])
    facts = json.loads(capsys.readouterr().out)
    assert facts["format"] == to
    assert facts["files"]
    written = {path for path in Path("out").rglob("*") if path.is_file()}
    assert written == {Path(file) for file in facts["files"]}
    assert all(path.stat().st_size > 0 for path in written)
    again = ab.export(ab.load_plan(kept / "line.plan"), Path("again") / f"x{FORMATS[to].suffix}", to)
    assert facts["loss"] == again.loss.record()
    assert [path.name for path in again.files if len(again.files) > 1] in (
        [],
        [Path(file).name for file in facts["files"]],
    )
    assert 0.0 < facts["loss"]["position_m"] < 0.1
    cli.main(["export", str(kept), "--to", to])
    said = capsys.readouterr().out
    assert str(again.loss) in said
    assert all(file in said for file in facts["files"])


def test_plans_of_folders_whose_names_end_in_other_numbers_have_files_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("line-pass-0.95", "line-pass-0.99"):
        Path(name).mkdir()
        shared_plan("line").save(Path(name) / "line.plan")
        cli.main(["export", name, "--to", "csv"])
    assert sorted(path.name for path in Path("out").iterdir()) == ["line-pass-0.95.csv", "line-pass-0.99.csv"]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("line.plan", "--to", "csw"), "csv"),
        (("line.plan",), "--to"),
        (("line.plan", "--to", "csv", "--rate", "0"), "rate"),
        (("line.plan", "--to", "crazyflie", "--rate", "10"), "rate"),
        (("line.plan", "--to", "blender", "--out", "scene.blend"), ".glb"),
        (("line.plan", "--to", "px4", "--out", "mine"), "thesis.tex"),
        (("cut.plan", "--to", "csv"), "cut.plan"),
        (("missing.plan", "--to", "csv"), "missing.plan"),
        (("path.csv", "--to", "mcap"), "path alone"),
    ],
)
def test_what_makes_no_sense_is_refused_in_a_sentence_and_nothing_is_written(
    arguments: tuple[str, ...],
    named: str,
    kept: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    content = (kept / "line.plan").read_bytes()
    Path("line.plan").write_bytes(content)
    Path("cut.plan").write_bytes(content[: len(content) // 2])
    Path("path.csv").write_text("t,x,y,z\n0,0,0,1\n1,1,0,1\n2,1,0,1\n3,1,0,1\n")
    Path("mine").mkdir()
    Path("mine/thesis.tex").write_text("years of work")
    before = sorted(tmp_path.rglob("*"))
    capsys.readouterr()
    with pytest.raises(SystemExit) as stop:
        cli.main(["export", *arguments])
    out, err = capsys.readouterr()
    assert stop.value.code == 2
    assert not out
    assert err.startswith("aerobat: ")
    assert err.count("\n") == 1
    assert named in err
    assert sorted(tmp_path.rglob("*")) == before


def test_bags_without_rosbags_are_refused_with_the_command_that_installs_it(
    kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(ab.BackendMissing, match=r'pip install "aerobat\[ros\]"'):
        ab.export(ab.load_plan(kept / "line.plan"), tmp_path / "x.bag", "ros1-bag")
    assert not list(tmp_path.iterdir())
