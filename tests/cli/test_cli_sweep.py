"""`aerobat sweep` and its folder: what is there, what goes on, what is repeated."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import aerobat as ab
from aerobat.cli.progress import Progress
from aerobat.interchange import read_table
from aerobat.studies.kept import KeptParts
from command_lines import code
from shared_plans import shared_plan

SPREAD = "mass = 0.03\nlag = 0.2\nstart_position = 0.02\n"  # quick to compile
RUNS = 60  # a chunk and a part of another


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("spread.toml").write_text(SPREAD)
    shared_plan("half-flip").save("half-flip.plan")


def swept(*more: str, what: str = "half-flip.plan", seed: int = 7) -> int:
    options = ("--runs", str(RUNS), "--conditions", "spread.toml", "--seed", str(seed), "--workers", "1")
    return code("sweep", what, *options, *more)


def test_a_sweep_writes_a_row_a_flight_and_counts_what_became_of_them(capsys) -> None:
    assert swept("--json") == 0
    facts = json.loads(capsys.readouterr().out)
    folder = Path("out/half-flip-sweep-spread-seed-7")
    assert {path.name for path in folder.iterdir()} == {
        "flights.csv", "half-flip.plan", "run.toml", "sweep.json", "sweep.png",
    }  # fmt: skip
    assert [path.name for path in Path("out").iterdir()] == [folder.name]  # nothing unfinished is left
    table = read_table(folder / "flights.csv")
    np.testing.assert_array_equal(table["flight"], np.arange(RUNS))
    assert facts == json.loads((folder / "sweep.json").read_bytes())
    assert sum(share["count"] for share in facts["outcomes"].values()) == facts["flights"] == RUNS
    passed = int((table["gate_outcome"] == "passed").sum())
    assert facts["passages"]["gate"]["passed"]["count"] == passed
    worst = facts["errors"]["max_position_error_m"]["100%"]
    assert worst == table["max_position_error_m"].max()
    low = facts["went_well"]["low"]
    assert low < facts["went_well"]["fraction"] <= facts["went_well"]["high"]


PARQUET = "out/half-flip-sweep-spread-seed-7-parquet"


@pytest.mark.slow
def test_a_repeated_sweep_comes_to_the_same_bits(capsys) -> None:
    assert swept("--table", "parquet") == 0
    shown = capsys.readouterr().out
    assert "went well" in shown
    assert shown.endswith(f"written to {PARQUET}/\n")
    Path("spread.toml").unlink()  # the folder holds its contents
    assert code("repeat", PARQUET) == 0
    assert f"the same as in {PARQUET}/, bit for bit" in capsys.readouterr().err


@pytest.mark.slow
def test_a_sweeps_plan_is_swept_again_as_it_is() -> None:
    assert swept("--table", "parquet") == 0
    again = ("--runs", "3", "--conditions", "spread.toml", "--seed", "7", "--out", "few")
    assert code("sweep", PARQUET, *again) == 0
    few, many = (read_table(path) for path in ("few/flights.csv", f"{PARQUET}/flights.parquet"))
    for name, column in few.items():
        np.testing.assert_array_equal(column, many[name][:3])


# is killed when the first flights are kept
KILLED = """
import os, signal, sys
from aerobat.cli import main
from aerobat.studies.kept import KeptParts

write = KeptParts.write
def write_and_die(self, *chunk):
    write(self, *chunk)
    os.kill(os.getpid(), signal.SIGKILL)
KeptParts.write = write_and_die
main(sys.argv[1:])
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ended_by", "code", "word"), [("SIGINT", 130, "interrupted"), ("SIGTERM", 143, "terminated")]
)
def test_the_same_command_goes_on_where_a_signal_ended_it(ended_by, code, word, monkeypatch, capsys) -> None:
    assert swept("--out", "whole", what="half-flip") == 0  # planned here, there from a file
    write = KeptParts.write

    def write_and_interrupt(*chunk: object) -> None:
        write(*chunk)
        signal.raise_signal(getattr(signal, ended_by))

    capsys.readouterr()
    with monkeypatch.context() as patch:
        patch.setattr(KeptParts, "write", write_and_interrupt)
        assert swept("--out", "there/broken") == code
    assert capsys.readouterr().err.splitlines() == [
        "aerobat: 50 of 60 flights are kept: the same command goes on from there",
        f"aerobat: {word}",
    ]
    assert [path.name for path in Path("there").iterdir()] == ["broken-unfinished"]
    assert swept("--out", "there/broken", seed=8) == 2
    assert "keeps flights of another sweep (seed)" in capsys.readouterr().err
    assert swept("--out", "there/broken") == 0
    assert capsys.readouterr().err == "aerobat: goes on from 50 of 60 flights, which are kept\n"
    assert [path.name for path in Path("there").iterdir()] == ["broken"]
    assert Path("there/broken/flights.csv").read_bytes() == Path("whole/flights.csv").read_bytes()


@pytest.mark.process
def test_the_same_command_goes_on_with_the_flights_that_are_kept(capsys) -> None:
    assert swept("--out", "whole", what="half-flip") == 0
    command = ("sweep", "half-flip", "--conditions", "spread.toml", "--seed", "7", "--out", "there/broken")
    ended = subprocess.run(
        [sys.executable, "-c", KILLED, *command, "--runs", str(RUNS)], capture_output=True, env=os.environ
    )
    assert ended.returncode == -signal.SIGKILL
    assert [path.name for path in Path("there").iterdir()] == ["broken-unfinished"]
    kept = ab.load_plan("there/broken-unfinished/sweep.plan")
    assert code(*command[:-1], "there/broken", "--runs", "60", "--order", "4") == 2  # another plan
    assert "an unfinished sweep with other settings" in capsys.readouterr().err
    assert code(*command, "--runs", str(RUNS)) == 0
    assert [path.name for path in Path("there").iterdir()] == ["broken"]
    assert Path("there/broken/flights.csv").read_bytes() == Path("whole/flights.csv").read_bytes()
    assert ab.load_plan("there/broken/half-flip.plan") == kept


# a worker is killed when it begins with the third chunk
KILLED_WORKER = """
import os, signal, sys
from aerobat.cli import main
from aerobat.studies.sweep import flights, sweep

whole = flights.fly_chunk
def fly_chunk(task, numbers):
    if numbers.start == 100:
        os.kill(os.getpid(), signal.SIGKILL)
    return whole(task, numbers)
fly_chunk.__module__ = flights.__name__
flights.fly_chunk = sys.modules["aerobat.studies.sweep.sweep"].fly_chunk = fly_chunk
main(sys.argv[1:])
"""


@pytest.mark.process
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a worker is no copy of what was changed")
def test_after_a_worker_was_killed_the_flights_that_are_kept_are_counted() -> None:
    options = ("--conditions", "spread.toml", "--runs", "150", "--workers", "2", "--out", "out")
    ended = subprocess.run(
        [sys.executable, "-c", KILLED_WORKER, "sweep", "half-flip.plan", *options],
        capture_output=True,
        text=True,
    )
    assert ended.returncode == 2
    kept, killed = ended.stderr.splitlines()[-2:]
    assert re.fullmatch(r"aerobat: \d+ of 150 flights are kept: the same command goes on from there", kept)
    assert killed == (
        "aerobat: worker processes were killed or have ended by themselves; "
        "where memory is short, take fewer workers"
    )


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--conditions", "lap"], "did you mean 'lab'?"),
        (["--runs", "0"], "runs"),
        (["--controller", "papr"], "did you mean 'paper'?"),
        (["--table", "xls"], "table"),
        (["--workers", "0"], "workers"),
        (["--out", "mine"], "mine/ holds thesis.tex, which no run wrote"),
        (["--out", "spread.toml"], "Not a directory"),
        (["--out", "x" * 300], "too long"),
    ],
)
def test_what_makes_no_sense_is_refused_before_anything_is_planned(arguments, named: str, capsys) -> None:
    Path("mine").mkdir()
    Path("mine/thesis.tex").write_text("years of work")
    assert code("sweep", "half-flip", *arguments) == 2
    err = capsys.readouterr().err
    assert named in err
    assert err.count("\n") == 1
    assert sorted(path.name for path in Path().iterdir()) == ["half-flip.plan", "mine", "spread.toml"]


def test_a_study_is_written_to_the_folder_that_one_is_in(monkeypatch, capsys) -> None:
    plan, there = Path("half-flip.plan").resolve(), Path("there").resolve()
    there.mkdir()
    monkeypatch.chdir(there)
    assert code("sweep", str(plan), "--runs", "3", "--out", "/") == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert code("sweep", str(plan), "--runs", "3", "--out", ".") == 0  # by name: another folder is there now
    assert (there / "flights.csv").exists()


@pytest.mark.parametrize("theirs", ["thesis.tex", "finished/thesis.tex", "finished/flights.npz"])
def test_a_folder_of_others_that_is_called_as_one_of_an_unfinished_sweep_is_left_alone(
    theirs: str, capsys
) -> None:
    file = Path("there-unfinished") / theirs
    file.parent.mkdir(parents=True)
    file.write_text("of years")
    for command in (("sweep", "half-flip.plan"), ("feasibility", "line", "--over", "vehicle.mass=1")):
        assert code(*command, "--out", "there") == 2
        assert f"holds {file.name}, which no run wrote" in capsys.readouterr().err
    assert file.read_text() == "of years"
    assert not Path("there").exists()


def test_a_sweep_that_cannot_be_flown_leaves_nothing(capsys) -> None:
    Path("nowhere.toml").write_text("computation_delay = 1.0\n")
    assert code("sweep", "half-flip.plan", "--conditions", "nowhere.toml", "--runs", "3") == 2
    assert "computation_delay" in capsys.readouterr().err
    left = {path.name for path in Path().rglob("*") if path.suffix != ".toml"}
    assert left <= {"half-flip.plan", "out"}


def test_progress_tells_how_many_how_well_and_how_long_still() -> None:
    now = [0.0]
    progress = Progress("flown", 200, lambda: now[0])
    assert str(progress) == "flown 0 of 200 in 0 s"
    now[0] = 5.0
    progress.counting("went well")(50, 49)
    assert str(progress) == "flown 50 of 200 in 5 s: 49 went well; 15 s to go"
